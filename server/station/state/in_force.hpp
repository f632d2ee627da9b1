// What a robot reports to be in force: its parameters and its controller.
//
// A robot sends both after each Welcome, and each change. Loop thread; one for each connection.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/station/state/station_state.hpp"

namespace server::station {

// Of the robot's parameters, those that bound its motion: only an admin changes them, with a confirmation.
bool bounds_motion(const std::string& parameter);

class ParameterTable {
 public:
  // Takes a page. True once every parameter is known and one of them has changed; last_known() is the table then. A
  // page that cannot be is passed over.
  bool add(const protocol::ParameterPage& page);

  // A new connection: what was known stays known, and is current again when the robot has reported the whole table.
  void begin_again();
  // The table as it was last whole; empty when it never was.
  const ReportedParameters& last_known() const { return last_known_; }
  bool is_current() const { return is_current_; }
  // Of the parameters that bound motion, those that differ from their default.
  std::vector<ChangedLimit> changed_limits() const;
  // Of last_known(), as the robot computes the one in its Hello (docs/protocol.md); a Hello is older than a change.
  std::uint32_t checksum() const;
  // The latest that was reported of one of them; none yet.
  std::optional<float> value(const std::string& name) const {
    const auto found = parameters_.find(name);
    return found == parameters_.end() ? std::nullopt : std::optional{found->second.value};
  }

 private:
  static constexpr std::uint32_t kMost = 256;  // parameters of a robot

  ReportedParameters parameters_, last_known_;
  std::map<std::uint32_t, std::string> names_;  // by index; of the latest reports
  bool is_current_ = false;                     // last_known_ was reported in this connection
};

// Whether they are the same bit for bit.
bool is_same(float a, float b);
bool is_same(const protocol::Controller& a, const protocol::Controller& b);

// What a robot has reported last.
struct RobotSettings {
  ParameterTable parameters;
  std::int64_t parameters_at_us = 0;  // UTC, when the table was last reported; 0: never
  std::optional<protocol::Controller> controller;
  std::int64_t controller_at_us = 0;
  bool is_controller_current = false;  // reported in this connection
  // What restore_controller brings back: none when the station has not seen it, as after a new connection.
  std::optional<protocol::Controller> controller_before;

  void begin_again();
  // `former`: what restore_controller brings back now; none: not known.
  void add(const protocol::Controller& reported, const std::optional<protocol::Controller>& former, std::int64_t at_us);
};

}  // namespace server::station
