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
#include <string>
#include <vector>

#include "server/config/envelope.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/station/state/station_sink.hpp"
#include "server/storage/runs/run.hpp"

namespace server::storage {

class RunDigester;
class Recorder;
class DatabaseReader;
struct RecordedSamples;

class Runs final : public station::StationSink {
 public:
  Runs(runtime::Clock& clock, Recorder& recorder, DatabaseReader& reader, RunDigester& digester);

  // Runs that were open when the station was killed are interrupted; the log names them, and those that its last stop
  // interrupted. Call before robots arrive.
  boost::asio::awaitable<void> load();
  // Until cancelled: does what load() could not do because the disk could not be written (no run begins before), and
  // reports runs whose end was stored later than somebody waited for it.
  boost::asio::awaitable<void> run();

  // Some run is open: it is to be interrupted when the recorder has written all that it received.
  bool any_open() const { return !open_runs_.empty(); }

  // Of an author the time is not looked at: it is now. create and end: unavailable while the disk cannot be written.
  // conflict when the robot has an open run, or somebody else is in control of it and the run names another fluid than
  // it is in; not_connected when it is not there, invalid for a bad name or fluid. A run that names none is in the
  // fluid that its robot is in.
  boost::asio::awaitable<Result<Run>> create(station::RobotId robot_id, RunConditions conditions,
                                             station::Author by = {});

  // A run of what was recorded already; it has ended. Its robot need not be there. invalid for a range without samples
  // or in the future, not_found for a robot or boot that is not known.
  boost::asio::awaitable<Result<Run>> make_afterwards(station::RobotId robot_id, RunConditions conditions,
                                                      RecordedRange range, station::Author by);

  // Changes what was said of the run; each change leaves a row in run_note. Its samples and their digest have
  // nothing to do with it. conflict for a discarded run.
  boost::asio::awaitable<Result<Run>> annotate(RunId id, RunAnnotation annotation, station::Author by);

  // The run holds its samples no longer, and is not listed any more. conflict while it is open.
  boost::asio::awaitable<Result<Run>> discard(RunId id, std::string reason, station::Author by);

  // Of the station's configuration, as JSON: what each run keeps of it.
  void set_station_document(std::string json) { station_document_ = std::move(json); }
  boost::asio::awaitable<Result<RunSnapshot>> snapshot(RunId id);
  boost::asio::awaitable<std::optional<PerformedProfile>> performed_profile(RunId id);  // none: of no experiment

  // The fluids that runs may name. Others are refused as invalid; before this call those that are built in.
  void set_envelope(config::Envelope envelope) { envelope_ = std::move(envelope); }
  // An open run that names a fluid says by it that its robot is in this fluid. What is refused here refuses the run.
  using OnFluid = std::function<Result<void>(const station::RobotId& robot_id, const std::string& fluid,
                                             const station::Author& by)>;
  void set_on_fluid(OnFluid on_fluid) { on_fluid_ = std::move(on_fluid); }

  // Each run that is made, ended, annotated or discarded, by people or by an experiment.
  using OnChange = std::function<void(const Run& run)>;
  void set_on_change(OnChange on_change) { on_change_ = std::move(on_change); }

  // Ends the run with the latest sample received until this call; that is fixed from now on, and stored in order with
  // the samples: after a kill the run ends there or earlier. Answers when that sample is durable or known lost, at most
  // 3 s after the end is stored. unavailable when it is not stored within 3 s, unless the caller waits `until_stored`:
  // it is tried until it is. conflict when it has ended, or is being ended.
  enum class Patience : std::uint8_t { of_a_person, until_stored };
  boost::asio::awaitable<Result<Run>> end(RunId id, std::string verdict, station::Author by = {},
                                          Patience patience = Patience::of_a_person);

  boost::asio::awaitable<Result<Run>> find(RunId id);

  boost::asio::awaitable<std::vector<Run>> list(RunFilter filter);

  // The conditions of the robot's newest run that states the pump's flow; none: no run states one.
  boost::asio::awaitable<std::optional<RunConditions>> last_flow(station::RobotId robot_id);

  void on_robot(const station::RobotState& robot) override;

 private:
  // What a new run takes from its robot.
  struct Robot {
    bool connected = false;
    station::BootId boot_id = 0;
    std::string firmware_version;
    std::uint32_t controller_id = 0;
    std::uint32_t controller_checksum = 0;
    std::uint32_t parameters_checksum = 0;
    std::string fluid;
  };

  struct Ending {
    bool is_awaited = true;  // by who asked for it, and reports it
  };
  // Nobody waits for it any more, however that came.
  struct Awaited {
    Awaited(std::map<RunId, Ending>& of, RunId run) : ending{of}, id{run} {}
    Awaited(const Awaited&) = delete;
    Awaited& operator=(const Awaited&) = delete;
    std::map<RunId, Ending>& ending;
    RunId id;
    ~Awaited() {
      if (const auto found = ending.find(id); found != ending.end()) found->second.is_awaited = false;
    }
  };

  static constexpr microseconds kLoadInterval{1'000'000};
  static Error no_such_run(RunId id);
  static Error end_is_not_stored(RunId id);

  boost::asio::awaitable<void> interrupt_open();
  void on_end_stored(RunId id);
  boost::asio::awaitable<bool> report_end(RunId id);
  boost::asio::awaitable<std::uint64_t> next_seq_of(station::BootId boot_id);
  Result<void> check_fluid(std::string& fluid) const;
  boost::asio::awaitable<Result<RecordedSamples>> samples_in(station::RobotId robot_id, RecordedRange range);
  boost::asio::awaitable<Result<Run>> changed(RunId id, Result<void> outcome);
  Run announced(Run run) const;

  // How far each robot's boot has come; what the database does not know yet of an open span.
  std::map<station::BootId, std::uint64_t> heads() const;
  boost::asio::awaitable<std::optional<Run>> read(RunId id);

  runtime::Clock& clock_;
  Recorder& recorder_;
  DatabaseReader& reader_;
  RunDigester& digester_;
  std::map<station::RobotId, Robot> robots_;
  std::map<station::RobotId, RunId> open_runs_;  // 0: being created
  bool is_loaded_ = false;
  std::string station_document_;
  config::Envelope envelope_;
  OnFluid on_fluid_ = [](const station::RobotId&, const std::string&, const station::Author&) {
    return Result<void>{};
  };
  OnChange on_change_ = [](const Run&) {};
  std::map<RunId, Ending> ending_;  // of open_runs_, those whose end is not stored yet
  std::vector<RunId> ended_late_;   // not reported yet
  runtime::Signal changed_;
};

}  // namespace server::storage
