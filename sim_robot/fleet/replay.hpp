// Recorded telemetry, prepared for sending as any robot at any time without encoding the samples again.
//
//   frame     := length 08 robot_time_us 22 length telemetry
//   telemetry := [08 first_seq] [10 first_robot_time_us] 18 period_us [20 oldest_seq] tail [60 flags]               (1)
// Numbers are varints; what is in [] is left out at 0. The tail is what was recorded, byte for byte: every field from
// `mode` on. Only the head is made anew, and for a frame that is sent again flags are added: of a field that comes
// twice the last one holds. Frames of a recording are repeated for ever: number n is n mod frames() of the recording.
// Errors: throws std::invalid_argument saying what is wrong with the file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "protocol/frame.hpp"

namespace sim_robot {

class Recording {
 public:
  // Delimited robot frames; what is not telemetry, and what is telemetry sent again, is passed over.
  explicit Recording(protocol::Bytes stream);

  std::uint64_t frames() const { return frames_.size(); }
  std::uint64_t samples() const { return samples_; }
  std::uint32_t period_us() const { return period_us_; }  // of its first frame

  // Of frame `number`, counted over all repetitions.
  std::uint64_t first_seq(std::uint64_t number) const;
  std::uint64_t end_seq(std::uint64_t number) const { return first_seq(number + 1); }
  // The frame that holds a sample.
  std::uint64_t frame_of(std::uint64_t seq) const;

  // The head of a robot's own frame; sample 0 was made at robot time 0.
  struct Head {
    std::uint64_t robot_time_us = 0;
    std::uint32_t period_us = 10'000;
    std::uint64_t oldest_seq = 0;
    bool is_sent_again = false;
  };
  // (1) to `out`; returns its size, or 0 when it does not fit.
  std::size_t write(std::uint64_t number, const Head& head, std::uint8_t* out, std::size_t capacity) const;

 private:
  struct Frame {
    std::uint64_t first_seq;  // within the recording
    std::uint32_t flags;
    std::size_t tail_start, tail_size;
  };
  void add(const protocol::Telemetry& batch);

  std::vector<Frame> frames_;
  std::vector<std::uint8_t> tails_;
  std::uint64_t samples_ = 0;
  std::uint32_t period_us_ = 0;
};

Recording load_recording(const std::filesystem::path& path);
// `seconds` of a simulated robot in auto, with its accelerometer and `samples_per_frame` samples in a frame.
Recording make_recording(double seconds, std::uint32_t samples_per_frame, std::uint64_t seed);

// The sample period at `rate` times the speed of the recording, in µs; throws when it cannot be.
std::uint32_t replay_period_us(const Recording& recording, double rate);

}  // namespace sim_robot
