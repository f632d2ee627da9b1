// One robot of a running station, as the commissioning uses it: what it says of itself, stops, experiments with their
// recordings, and control of it meanwhile.
//
// Every request has an end, and between two requests Ctrl-C is noticed (throws Interrupted), but not while the robot is
// being stopped. Errors: throws std::runtime_error with what the station refused, or that it does not answer.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/commission/motion.hpp"
#include "server/cli/commission/person.hpp"

namespace server::cli {

// The outcome of an emergency stop.
struct StopAnswer {
  bool is_confirmed = false;  // by the robot
  double confirmed_ms = 0;    // from the station's receipt of the request
  std::string emergency_id;
  std::string why;  // of one that is not confirmed
};

// A profile that the robot has performed to its end.
struct RecordedRun {
  std::int64_t run_id = 0;
  std::vector<RecordedSample> samples;
  nlohmann::ordered_json reference;  // run_id, purpose, counts of samples, digest
};

RecordedSample sample_in(const nlohmann::json& row);  // of a page of samples

class RobotAccess {
 public:
  RobotAccess(const std::filesystem::path& data_dir, std::string robot_id, Interruption& interruption);

  nlohmann::json station() const { return get("/api/v1/station"); }
  nlohmann::json state() const { return get(path_); }
  nlohmann::json controller() const { return get(path_ + "/controller").at("controller"); }
  // By name. Throws when the robot has not reported them.
  nlohmann::json parameters() const;

  void take_control();  // for 15 s, and each command and each sign of life prolongs it
  void keep_control();  // again when 5 s have passed
  void release_control() const noexcept;

  // SAFETY: takes at most 7 s, whatever the station does; never throws.
  StopAnswer stop() const;
  // The stop first, then the end of what perform() left behind, also of an experiment whose request may have arrived
  // without an answer. Never throws.
  StopAnswer stop_and_end();
  // Waits until the robot is seen in emergency at duty 0, then resets this stop and waits for that too.
  void reset(const std::string& emergency_id) const;

  // Gives signs of life while it lasts: when they end, and no other tool with the same token gives any, the robot
  // stops. Throws when it does not begin within 50 s, does not end as planned, or a step was repeated.
  RecordedRun perform(const nlohmann::json& profile);
  DutyAnswer try_duty(double duty) const;                               // a command for 1 ms
  nlohmann::json fit(std::int64_t run_id, std::string& failure) const;  // null, with the reason
  // The robot is at rest. The reason when it has not taken it, else empty.
  std::string set_parameter(const std::string& name, double value) const;
  // A line of the station's own record; the reason when it is not stored, else empty.
  std::string mark(const std::string& line) const;

 private:
  StationAnswer ask(const std::string& method, const std::string& target, const nlohmann::json& body) const;
  nlohmann::json get(const std::string& target) const { return asked(ask("GET", target, nullptr)); }
  nlohmann::json post(const std::string& target, const nlohmann::json& body) const {
    return asked(ask("POST", target, body));
  }
  void abort_own_experiments() const;
  std::vector<RecordedSample> samples_of(std::int64_t run_id) const;
  nlohmann::ordered_json reference_of(std::int64_t run_id, const std::string& purpose) const;

  StationClient client_;
  std::string path_;
  std::string robot_id_;
  Interruption& interruption_;
  std::string notes_;               // of its experiments, by which it knows them again
  bool has_experiment_ = false;     // one may be open
  std::int64_t controlled_us_ = 0;  // steady, when control was last taken
};

DutyAnswer duty_answer(const StationAnswer& answer);

// Of a run in an experiment's document.
bool has_repeated_step(const nlohmann::json& run);

}  // namespace server::cli
