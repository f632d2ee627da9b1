// A queue of notes; those that a later one makes needless are dropped.
#include "server/storage/upkeep/sample_ages.hpp"

namespace server::storage {

void SampleAges::begin(std::int64_t next_row) {
  begun_row_ = next_row;
  notes_ = {{clock_.steady_us(), next_row}};
}

void SampleAges::note(std::int64_t next_row) {
  const std::int64_t now_us = clock_.steady_us();
  if (notes_.empty() || now_us - notes_.back().steady_us < age_us_ / 100) return;
  notes_.push_back({now_us, next_row});
  while (notes_[1].steady_us <= now_us - age_us_) notes_.pop_front();
}

AgeLimit SampleAges::limit() const {
  const std::int64_t then_us = clock_.steady_us() - age_us_;
  AgeLimit limit{0, begun_row_, clock_.utc_us() - age_us_};
  for (const Note& note : notes_) {
    if (note.steady_us <= then_us) limit.row = note.next_row;
  }
  return limit;
}

}  // namespace server::storage
