// The last 8 s of samples, kept until the station has them on disk.
//
// A sample holds only the values that change in every tick. Values that change rarely (mode, setpoint, time base...)
// are stored once, as a segment with the first seq it applies to; a sample's time is its segment's first time plus
// whole periods. 21.6 kB; on the ESP8266 7.7 kB of them lie outside, in memory that the board provides.
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>

#include "protocol/messages.hpp"

namespace robot_fw {

struct Sample {
  float position_m = 0;  // as the controller saw it, disturbance included
  float velocity_m_s = 0;
  float acceleration_m_s2 = 0;
  float duty = 0;
  float impedance_mv = 0;
  float reference_m = 0;  // 0 without a setpoint
};

// How many of the ring's samples lie outside of it. The platform decides, since the Arduino IDE passes no
// definitions of ours.
#if defined(ARDUINO_ARCH_ESP8266)
constexpr std::size_t kSamplesElsewhere = 320;
#else
constexpr std::size_t kSamplesElsewhere = 0;
#endif

// The values that a batch of telemetry carries once.
struct BatchValues {
  std::uint64_t emergency_id = 0;
  float setpoint_m = 0;  // 0 without one
  float disturbance_m = 0;
  float position_sd_m = 0;
  std::uint32_t controller_id = 0;
  std::uint16_t flags = 0;
  std::uint8_t mode = 0;
  std::uint8_t sub_state = 0;
  std::uint8_t emergency_cause = 0;
  bool has_setpoint = false;

  bool operator==(const BatchValues& other) const;
};

class TelemetryRing {
 public:
  static constexpr std::size_t kCapacity = 800;
  static constexpr std::size_t kMaxSegments = 32;

  // Memory for kSamplesElsewhere samples, for the life of the program, set before the first push. There is one for all
  // rings: where some samples lie elsewhere, a program has one ring and copies none. It is only accessed as whole words
  // of 32 bits, and what it holds at first does not matter.
  static void set_memory_elsewhere(Sample* samples) { elsewhere = samples; }

  // Numbers the sample and keeps it. Starts a segment when a batch value changed or time did not move by one period;
  // says whether it did. The oldest sample, or segment, makes room and is counted as lost.
  bool push(const Sample& sample, const BatchValues& values, bool saturated, std::uint64_t robot_time_us,
            std::uint32_t period_us);
  // Forgets every sample below `next_seq`; a number above next_seq() is ignored.
  void acknowledge(std::uint64_t next_seq);
  // Fills `batch` with samples from `first_seq` on, at most `max_samples` and never beyond a segment;
  // `first_seq` must lie in [oldest_seq(), next_seq()).
  void read(std::uint64_t first_seq, std::size_t max_samples, protocol::Telemetry& batch) const;

  std::uint64_t oldest_seq() const { return oldest_seq_; }
  std::uint64_t next_seq() const { return next_seq_; }
  // The highest number that acknowledge() took.
  std::uint64_t acknowledged_next_seq() const { return acknowledged_next_seq_; }
  std::uint32_t fill() const { return static_cast<std::uint32_t>(next_seq_ - oldest_seq_); }
  std::uint32_t lost() const { return lost_; }

 private:
  struct Segment {
    std::uint64_t first_seq;
    std::uint64_t first_robot_time_us;
    std::uint32_t period_us;
    BatchValues values;
  };
  const Segment& segment(std::uint64_t number) const { return segments_[number % kMaxSegments]; }
  bool continues(const BatchValues& values, std::uint64_t robot_time_us, std::uint32_t period_us) const;
  void forget_below(std::uint64_t seq);
  const Sample& place(std::size_t at) const {
    return at < kSamplesElsewhere ? elsewhere[at] : samples_[at - kSamplesElsewhere];
  }
  Sample& place(std::size_t at) { return at < kSamplesElsewhere ? elsewhere[at] : samples_[at - kSamplesElsewhere]; }

  static inline Sample* elsewhere = nullptr;
  std::array<Sample, kCapacity - kSamplesElsewhere> samples_{};
  std::bitset<kCapacity> saturated_;
  std::array<Segment, kMaxSegments> segments_{};
  std::uint64_t oldest_segment_ = 0, next_segment_ = 0;  // numbers, as of samples
  std::uint64_t oldest_seq_ = 0, next_seq_ = 0, acknowledged_next_seq_ = 0;
  std::uint32_t lost_ = 0;
};

static_assert(sizeof(Sample) == 24 && alignof(Sample) == 4, "a sample is six words");
static_assert(sizeof(TelemetryRing) + kSamplesElsewhere * sizeof(Sample) <= 22'000,
              "the ring outgrew its memory on the robot");

}  // namespace robot_fw
