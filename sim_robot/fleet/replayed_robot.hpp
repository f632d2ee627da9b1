// A robot for load tests that computes nothing: it sends the frames of a recording as its own, on time.
//
// To a station it is a robot with a boot of its own, samples from 0 on without a gap, a clock that runs with the
// host's, acknowledgements, resends and a ring of kRingSamples that keeps the numbers of what falls out. As frames can
// be written again at any time, it keeps numbers and not bytes. It answers clock probes, says its status each second,
// and refuses every command as unsupported: it has no motor. So it never acknowledges an emergency stop as carried out.
// One thread: that of `loop`. Loop and recording must outlive the robot.
#pragma once

#include <deque>
#include <vector>

#include "sim_robot/client/fleet_member.hpp"
#include "sim_robot/client/lateness.hpp"
#include "sim_robot/fleet/replay.hpp"

namespace sim_robot {

struct ReplayConfig {
  std::string robot_id = "sim-1";
  std::string token;
  std::uint64_t boot_id = 1;
  std::uint32_t period_us = 10'000;        // of samples
  Lateness* acknowledged_after = nullptr;  // of each frame, from its last sample to its acknowledgement
};

struct SampleRange {  // [first, next)
  std::uint64_t first = 0, next = 0;
};

class ReplayedRobot final : public FleetMember, private Speaker {
 public:
  static constexpr std::uint64_t kRingSamples = 800;

  ReplayedRobot(boost::asio::io_context& loop, ReplayConfig config, const Recording& recording, StationAddress station,
                LinkLog log);

  // Of the wheel: a turn, or several, for each frame of mean length.
  static std::chrono::microseconds turn_period(const Recording& recording, std::uint32_t period_us);

  // The first sample is made one period after the turn, so that the last sample of a frame is made at a turn.
  void boot(Clock::time_point at) override { booted_at_ = at + std::chrono::microseconds(config_.period_us); }
  bool tick() override;
  void send() override { connection_.flush(); }
  Clock::time_point next_tick_at() const override;
  boost::asio::awaitable<void> stay_connected() override { return connection_.run(); }

  SampleCounts samples() const override;
  const StationConnection& connection() const override { return connection_; }
  // What left the ring before it was acknowledged, ascending: whole frames, of some of which the station may have had a
  // part. A station may note no other sample as overrun.
  const std::vector<SampleRange>& overwritten() const { return overwritten_; }
  const ReplayConfig& config() const { return config_; }
  std::uint64_t acknowledged_next_seq() const { return acknowledged_next_seq_; }

 private:
  enum class Phase { closed, greeting, up };
  struct Run {  // of frames: [next, end)
    std::uint64_t next = 0, end = 0;
  };

  void on_opened() override;
  void on_closed() override { phase_ = Phase::closed; }
  bool on_bytes(protocol::Bytes bytes) override;
  std::size_t next_frame(std::uint8_t* out, std::size_t capacity) override;
  bool is_welcome() const override { return phase_ == Phase::up; }
  protocol::RefusalReason refusal() const override { return refusal_; }
  std::string refusal_detail() const override { return {}; }
  bool ring_has_room() const override { return !gap_grows_; }

  bool on_frame(const protocol::StationFrame& frame);
  bool on_welcome(const protocol::Welcome& welcome);
  void acknowledge(std::uint64_t next_seq);
  void resend(std::uint64_t first_seq, std::uint64_t end_seq);
  void make_frames();
  std::size_t write_telemetry(Run& run, bool again, std::uint8_t* out, std::size_t capacity);
  bool fill_small_frame(protocol::RobotFrame& frame);
  void fill_hello(protocol::Hello& hello) const;
  std::uint64_t robot_time_us() const;
  std::uint64_t oldest_seq() const { return recording_.first_seq(oldest_); }

  ReplayConfig config_;
  const Recording& recording_;
  Clock::time_point booted_at_;
  StationConnection connection_;
  Phase phase_ = Phase::closed;
  protocol::RefusalReason refusal_ = rheonaut_REFUSAL_REASON_NONE;
  protocol::FrameReader reader_;

  std::uint64_t next_ = 0, oldest_ = 0;  // frames: made next, held
  Run live_, backfill_;
  int backfill_credit_ = 0;  // frames that may be sent again in this turn
  bool hello_is_due_ = false;
  std::deque<std::uint64_t> commands_;  // to be answered
  protocol::Heartbeat echo_ = rheonaut_Heartbeat_init_zero;
  std::uint64_t stop_probe_us_ = 0;  // to be answered; 0: none
  std::uint64_t received_at_us_ = 0, sent_at_us_ = 0, status_due_us_ = 0;
  std::uint64_t silence_us_ = 0, heartbeat_us_ = 0;
  std::uint64_t acknowledged_next_seq_ = 0;
  SampleCounts counts_;
  std::vector<SampleRange> overwritten_;
  bool gap_grows_ = false;
};

}  // namespace sim_robot
