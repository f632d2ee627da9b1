// Computes when each segment arrives, and keeps it until then.
#include "sim_robot/network/impairment.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace sim_robot {
namespace {

constexpr std::size_t kMaxSegmentBytes = 1460;
constexpr double kThrottledSegmentS = 0.01;
constexpr int kMaxLosses = 8;  // in a row: 51 s with the usual time-out, then TCP would be near giving up

void check_range(const char* name, double value, double max) {
  if (!(value >= 0 && value <= max)) {
    throw std::invalid_argument(std::string(name) + " " + std::to_string(value) + " is not within 0 and " +
                                std::to_string(max));
  }
}

}  // namespace

void check(const Impairment& impairment) {
  constexpr double kDayS = 86'400;
  check_range("delay_s", impairment.delay_s, kDayS);
  check_range("jitter_s", impairment.jitter_s, kDayS);
  check_range("bytes_per_s", impairment.bytes_per_s, 1e12);
  check_range("loss_probability", impairment.loss_probability, 0.99);
  check_range("retransmit_s", impairment.retransmit_s, kDayS);
  if (impairment.retransmit_s < 1e-3) throw std::invalid_argument("retransmit_s is below 0.001");
  if (impairment.buffer_bytes == 0) throw std::invalid_argument("buffer_bytes is 0: nothing could ever be sent");
}

ImpairedStream::ImpairedStream(const Impairment& impairment, std::uint64_t seed)
    : impairment_(impairment), random_(seed) {
  check(impairment);
}

void ImpairedStream::impair(const Impairment& impairment, std::uint64_t now_us) {
  check(impairment);
  const double before_bytes_per_s = std::exchange(impairment_, impairment).bytes_per_s;
  const bool is_wider =
      before_bytes_per_s > 0 && (impairment.bytes_per_s <= 0 || impairment.bytes_per_s > before_bytes_per_s);
  if (is_wider && !revived_at_us_) hurry(now_us);
}

void ImpairedStream::hurry(std::uint64_t now_us) {
  sent_us_ = now_us;
  for (Segment& segment : segments_) {
    const auto size = static_cast<double>(segment.bytes.size() - segment.taken);
    if (impairment_.bytes_per_s > 0) sent_us_ += microseconds(size / impairment_.bytes_per_s);
    segment.due_us = std::min(segment.due_us, sent_us_ + microseconds(impairment_.delay_s));
  }
  if (!segments_.empty()) last_due_us_ = segments_.back().due_us;
}

std::size_t ImpairedStream::push(protocol::Bytes bytes, std::uint64_t now_us) {
  const std::size_t count = std::min(bytes.size, room());
  for (std::size_t at = 0; at < count;) {
    const std::size_t size = std::min(segment_bytes(), count - at);
    const auto* first = bytes.first + at;
    segments_.push_back({{first, first + size}, due_us(size, now_us)});
    at += size;
  }
  held_ += count;
  return count;
}

void ImpairedStream::close(std::uint64_t now_us) {
  if (closed_) return;
  segments_.push_back({{}, due_us(0, now_us)});
  closed_ = true;
}

void ImpairedStream::cut(std::size_t after_bytes, std::uint64_t now_us) {
  if (closed_) return;
  while (held_ > after_bytes) {
    Segment& last = segments_.back();
    const std::size_t size = std::min(held_ - after_bytes, last.bytes.size() - last.taken);
    last.bytes.resize(last.bytes.size() - size);
    held_ -= size;
    if (last.taken == last.bytes.size()) segments_.pop_back();
  }
  close(now_us);
}

std::size_t ImpairedStream::pull(std::uint8_t* out, std::size_t capacity, std::uint64_t now_us) {
  if (impairment_.split_bytes > 0) capacity = std::min(capacity, impairment_.split_bytes);
  std::size_t count = 0;
  while (count < capacity && !segments_.empty() && segments_.front().due_us <= now_us) {
    Segment& segment = segments_.front();
    if (segment.bytes.empty()) break;
    const std::size_t size = std::min(capacity - count, segment.bytes.size() - segment.taken);
    std::copy_n(segment.bytes.begin() + static_cast<std::ptrdiff_t>(segment.taken), size, out + count);
    segment.taken += size;
    count += size;
    if (segment.taken == segment.bytes.size()) segments_.pop_front();
  }
  held_ -= count;
  return count;
}

bool ImpairedStream::ended(std::uint64_t now_us) const {
  return closed_ && segments_.front().bytes.empty() && segments_.front().due_us <= now_us;
}

std::optional<std::uint64_t> ImpairedStream::next_at_us() const {
  if (segments_.empty() || segments_.front().due_us == kNever) return std::nullopt;
  return segments_.front().due_us;
}

void ImpairedStream::stall(std::uint64_t now_us, std::uint64_t until_us) {
  const std::uint64_t stalled_from_us = revived_at_us_.value_or(kNever);  // those wait in a stall already
  stalled_until_us_ = until_us;
  revived_at_us_.reset();
  last_due_us_ = 0;
  for (Segment& segment : segments_) {
    const std::uint64_t arrival_us = segment.due_us >= stalled_from_us ? now_us : segment.due_us;
    const bool under_way = segment.due_us > now_us;
    last_due_us_ = std::max(last_due_us_, under_way ? after_stall(arrival_us) : segment.due_us);
    segment.due_us = last_due_us_;
  }
}

void ImpairedStream::resume(std::uint64_t now_us) {
  const bool some_wait = revived_at_us_.value_or(0) > now_us;
  stalled_until_us_ = 0;
  revived_at_us_.reset();
  if (!some_wait) return;
  for (Segment& segment : segments_) segment.due_us = std::min(segment.due_us, now_us);
  last_due_us_ = std::min(last_due_us_, now_us);
}

// Of a segment that is sent now: (1), (2) and (3).
std::uint64_t ImpairedStream::due_us(std::size_t size, std::uint64_t now_us) {
  if (revived_at_us_ && now_us >= *revived_at_us_) revived_at_us_.reset();
  sent_us_ = std::max(sent_us_, now_us);
  if (impairment_.bytes_per_s > 0) sent_us_ += microseconds(static_cast<double>(size) / impairment_.bytes_per_s);
  std::uniform_real_distribution<double> uniform{0, 1};
  const double jitter_s = impairment_.jitter_s * uniform(random_);
  int losses = 0;
  while (losses < kMaxLosses && uniform(random_) < impairment_.loss_probability) ++losses;
  const std::uint64_t arrival_us = sent_us_ + microseconds(impairment_.delay_s + jitter_s) + retransmission_us(losses);
  last_due_us_ = std::max(last_due_us_, after_stall(arrival_us));
  return last_due_us_;
}

// What would arrive during a stall comes with the first segment of it that gets through again.
std::uint64_t ImpairedStream::after_stall(std::uint64_t arrival_us) {
  if (arrival_us >= stalled_until_us_) return arrival_us;
  if (stalled_until_us_ == kNever) revived_at_us_ = kNever;
  for (int losses = 1; !revived_at_us_; ++losses) {
    const std::uint64_t again_us = arrival_us + retransmission_us(losses);
    if (again_us >= stalled_until_us_) revived_at_us_ = again_us;
  }
  return *revived_at_us_;
}

std::uint64_t ImpairedStream::retransmission_us(int losses) const {
  return microseconds(impairment_.retransmit_s * (std::ldexp(1, losses) - 1));
}

std::size_t ImpairedStream::segment_bytes() const {
  if (impairment_.bytes_per_s <= 0) return kMaxSegmentBytes;
  const double bytes = impairment_.bytes_per_s * kThrottledSegmentS;
  return static_cast<std::size_t>(std::clamp(bytes, 1.0, static_cast<double>(kMaxSegmentBytes)));
}

}  // namespace sim_robot
