// How long ago samples, or events, were stored, independent of changes of the station's clock.
//
// Rows are numbered in the order in which they are written. So it is enough to note, from time to time, the steady time
// and the number of the next row: all below it are older than the note. What an earlier start of the program has
// written has only the UTC of its arrival; that is compared with the time by which things grow old (RemovalClock).
//
// Loop thread. Steady times and UTC in microseconds.
#pragma once

#include <cstdint>
#include <deque>

#include "server/storage/database/removal_clock.hpp"

namespace server::storage {

// Which samples are old enough.
struct AgeLimit {
  std::int64_t row = 0;                 // those with a smaller row
  std::int64_t earlier_row = 0;         // those with a smaller row ...
  std::int64_t received_before_us = 0;  // ... that arrived before this UTC

  bool covers(std::int64_t last_row, std::int64_t received_at_us) const {
    return last_row < row || (last_row < earlier_row && received_at_us < received_before_us);
  }
};

class SampleAges {
 public:
  // The age that is asked for. It is kept to a hundredth.
  SampleAges(const RemovalClock& clock, std::int64_t age_us) : clock_{clock}, age_us_{age_us} {}

  // The program writes rows from this one on.
  void begin(std::int64_t next_row);
  // It has come to this one; nothing before begin().
  void note(std::int64_t next_row);

  AgeLimit limit() const;

 private:
  struct Note {
    std::int64_t steady_us = 0;
    std::int64_t next_row = 0;
  };

  const RemovalClock& clock_;
  std::int64_t age_us_;
  std::int64_t begun_row_ = 0;
  std::deque<Note> notes_;  // the first one is the latest that is old enough, if any is
};

}  // namespace server::storage
