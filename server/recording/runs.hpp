// Runs: named spans of a robot's recording, with the conditions of the experiment.
//
// Recording is always on; a run only says which samples belong together. A reboot of the robot opens a new span. At
// most one run per robot is open. Loop thread; the database work is done on the disk thread.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/clock.hpp"
#include "server/result.hpp"
#include "server/station/station_sink.hpp"

namespace server {

class Recorder;

using RunId = std::int64_t;

enum class RunState : std::uint8_t {
  open,
  ended,
  interrupted,  // the station stopped while it was open
  discarded,    // its samples are no longer held
};
const char* text(RunState value);

// What the experimenter says of a run; all optional but the name.
struct RunConditions {
  std::string name;
  std::string fluid;  // e.g. "non_newtonian", "water"
  std::string pump_profile;
  std::optional<double> mean_flow_m_s;
  std::string tube;
  std::string operator_name;
  std::string profile;  // of the experiment, e.g. "step to 0.1 m"; pump_profile is the pump's
  std::string notes;
  std::string verdict;
};

struct RunSpan {
  BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::optional<std::uint64_t> last_seq;  // inclusive; empty while the span is open
};

struct Run {
  RunId id = 0;
  RobotId robot_id;
  RunState state = RunState::open;
  bool made_afterwards = false;  // from what had been recorded already
  std::string made_by;           // the actor, e.g. "token:local"; empty: not known
  RunConditions conditions;
  std::string firmware_version;
  std::uint32_t controller_id = 0;
  std::uint32_t controller_checksum = 0;
  std::uint32_t parameters_checksum = 0;
  std::int64_t started_at_us = 0;  // UTC
  std::optional<std::int64_t> ended_at_us;
  std::vector<RunSpan> spans;
  std::uint64_t samples_expected = 0;  // so far, in all spans
  std::uint64_t samples_stored = 0;
  std::uint64_t samples_lost = 0;  // known to be lost for good; expected - stored - lost is still on its way
};

class Runs final : public StationSink {
 public:
  Runs(Clock& clock, Recorder& recorder);

  // Reads the runs that were open when the station stopped; they go on. Call before robots arrive.
  boost::asio::awaitable<void> load();

  // create and end: unavailable while the disk cannot be written.
  // conflict when the robot has an open run, not_connected when it is not there, invalid for a bad name.
  boost::asio::awaitable<Result<Run>> create(RobotId robot_id, RunConditions conditions, std::string made_by = {});

  // Ends the run with the latest sample received. Answers when that sample is durable or known lost, at most 3 s later.
  boost::asio::awaitable<Result<Run>> end(RunId id, std::string verdict);

  boost::asio::awaitable<Result<Run>> find(RunId id);

  // Newest first; `before` 0: from the newest. At most `limit` (1 to 1000).
  boost::asio::awaitable<std::vector<Run>> list(std::optional<RobotId> robot_id, RunId before, std::size_t limit);

  void on_robot(const RobotState& robot) override;
  void on_samples(const RobotState& robot, const SampleBatch& batch) override;

 private:
  // What a new run takes from its robot.
  struct Robot {
    bool connected = false;
    BootId boot_id = 0;
    std::string firmware_version;
    std::uint32_t controller_id = 0;
    std::uint32_t controller_checksum = 0;
    std::uint32_t parameters_checksum = 0;
  };

  // How far each robot's boot has come; what the database does not know yet of an open span.
  std::map<BootId, std::uint64_t> heads() const;
  boost::asio::awaitable<std::optional<Run>> read(RunId id);

  Clock& clock_;
  Recorder& recorder_;
  std::map<RobotId, Robot> robots_;
  std::map<RobotId, RunId> open_runs_;  // 0: being created
  std::set<RunId> ending_;              // of these, the ones whose end is being stored
};

}  // namespace server
