// Runs: named spans of a robot's recording, with the conditions of the experiment.
//
// Recording is always on; a run only says which samples belong together. A reboot of the robot opens a new span. At
// most one run per robot is open, and none stays open when the station stops, for then nobody watches. Loop thread;
// what changes a run is done on the disk thread, what reads runs on the readers'.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "server/audit_note.hpp"
#include "server/clock.hpp"
#include "server/result.hpp"
#include "server/station/envelope.hpp"
#include "server/station/station_sink.hpp"

namespace server {

class Certifier;
class Recorder;
class DatabaseReader;
struct RecordedSamples;

using RunId = std::int64_t;

enum class RunState : std::uint8_t {
  open,
  ended,
  interrupted,  // the station stopped while it was open
  discarded,    // its samples are no longer held
};
const char* text(RunState value);
std::optional<RunState> run_state_from(const std::string& text);

// What the experimenter says of a run; all optional but the name.
struct RunConditions {
  std::string name;
  std::string fluid;  // as Envelope lists it, or as it was written before there was a list; empty: not known
  std::string pump_profile;
  std::optional<double> mean_flow_m_s;
  std::string tube;
  std::string operator_name;
  std::string profile;  // of the experiment, e.g. "step to 0.1 m"; pump_profile is the pump's
  std::string notes;
  std::string verdict;
};

// What is to be said otherwise of a run: the conditions that are given, by their names in RunConditions.
struct RunAnnotation {
  std::map<std::string, std::string> texts;
  bool has_mean_flow = false;
  std::optional<double> mean_flow_m_s;
  bool names_fluid_of_robot = true;  // the fluid of an open run is its robot's, too
};

// Samples of a robot that were recorded already.
struct TimeSpan {  // UTC, both ends included; over reboots
  std::int64_t from_us = 0;
  std::int64_t to_us = 0;
};
struct SeqSpan {  // both ends included
  BootId boot_id = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t last_seq = 0;
};
using RecordedRange = std::variant<TimeSpan, SeqSpan>;

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

// What a run was made with, as far as it is known.
struct InForce {
  std::uint32_t span = 0;
  std::string kind;             // controller, parameters, station
  std::uint64_t first_seq = 0;  // of the span: in force from here on
  std::string content;          // JSON
};
struct RunSnapshot {
  std::string firmware_version;
  std::uint32_t controller_id = 0;
  std::uint32_t controller_checksum = 0;
  std::uint32_t parameters_checksum = 0;
  std::vector<InForce> in_force;  // in order of span, kind and first_seq
};

// Which runs, newest first.
struct RunFilter {
  std::optional<RobotId> robot_id;
  std::optional<RunState> state;  // empty: all but the discarded
  RunId before = 0;               // 0: from the newest
  std::size_t limit = 100;        // 1 to 1000
};

class Runs final : public StationSink {
 public:
  Runs(Clock& clock, Recorder& recorder, DatabaseReader& reader, Certifier& certifier);

  // Runs that were open when the station was killed are interrupted; the log names them, and those that its last stop
  // interrupted. Call before robots arrive.
  boost::asio::awaitable<void> load();
  // What load() could not do, because the disk could not be written: until it is done. No run begins before.
  boost::asio::awaitable<void> finish_loading();

  // Some run is open: it is to be interrupted when the recorder has written all it heard.
  bool any_open() const { return !open_runs_.empty(); }

  // Of an author the time is not looked at: it is now. create and end: unavailable while the disk cannot be written.
  // conflict when the robot has an open run, or somebody else is in control of it and the run names another fluid than
  // it is in; not_connected when it is not there, invalid for a bad name or fluid. A run that names none is in the
  // fluid that its robot is in.
  boost::asio::awaitable<Result<Run>> create(RobotId robot_id, RunConditions conditions, Author by = {});

  // A run of what was recorded already; it has ended. Its robot need not be there. invalid for a range without samples
  // or in the future, not_found for a robot or boot that is not known.
  boost::asio::awaitable<Result<Run>> make_afterwards(RobotId robot_id, RunConditions conditions, RecordedRange range,
                                                      Author by);

  // Changes what was said of the run; each change leaves a row in run_note. Its samples and their certificate have
  // nothing to do with it. conflict for a discarded run.
  boost::asio::awaitable<Result<Run>> annotate(RunId id, RunAnnotation annotation, Author by);

  // The run holds its samples no longer, and is not listed any more. conflict while it is open.
  boost::asio::awaitable<Result<Run>> discard(RunId id, std::string reason, Author by);

  // Of the station's configuration, as JSON: what each run keeps of it.
  void set_station_document(std::string json) { station_document_ = std::move(json); }
  boost::asio::awaitable<Result<RunSnapshot>> snapshot(RunId id);

  // The fluids that runs may name. Others are refused as invalid; before this call those that are built in.
  void set_envelope(Envelope envelope) { envelope_ = std::move(envelope); }
  // An open run that names a fluid says by it that its robot is in this fluid. What is refused here refuses the run.
  using OnFluid = std::function<Result<void>(const RobotId& robot_id, const std::string& fluid, const Author& by)>;
  void set_on_fluid(OnFluid on_fluid) { on_fluid_ = std::move(on_fluid); }

  // Ends the run with the latest sample received. Answers when that sample is durable or known lost, at most 3 s later.
  boost::asio::awaitable<Result<Run>> end(RunId id, std::string verdict, Author by = {});

  boost::asio::awaitable<Result<Run>> find(RunId id);

  boost::asio::awaitable<std::vector<Run>> list(RunFilter filter);

  void on_robot(const RobotState& robot) override;

 private:
  // What a new run takes from its robot.
  struct Robot {
    bool connected = false;
    BootId boot_id = 0;
    std::string firmware_version;
    std::uint32_t controller_id = 0;
    std::uint32_t controller_checksum = 0;
    std::uint32_t parameters_checksum = 0;
    std::string fluid;
  };

  boost::asio::awaitable<void> interrupt_open();
  Result<void> check_fluid(std::string& fluid) const;
  boost::asio::awaitable<Result<RecordedSamples>> samples_in(RobotId robot_id, RecordedRange range);
  boost::asio::awaitable<Result<Run>> changed(RunId id, Result<void> outcome);

  // How far each robot's boot has come; what the database does not know yet of an open span.
  std::map<BootId, std::uint64_t> heads() const;
  boost::asio::awaitable<std::optional<Run>> read(RunId id);

  Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
  Certifier& certifier_;
  std::map<RobotId, Robot> robots_;
  std::map<RobotId, RunId> open_runs_;  // 0: being created
  bool is_loaded_ = false;
  std::string station_document_;
  Envelope envelope_;
  OnFluid on_fluid_ = [](const RobotId&, const std::string&, const Author&) { return Result<void>{}; };
  std::set<RunId> ending_;  // of these, the ones whose end is being stored
};

}  // namespace server
