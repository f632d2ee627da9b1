// Sends a robot the model of its fluid, or takes back what was confirmed before, and reads back what the robot holds.
//
//   the parameters of the model that the robot does not hold yet, one by one, each read back
//     → model_confirmed = 1, once all eight are the model's → done when telemetry shows it
//   a model that is assumed only: model_confirmed = 0, seen in telemetry, and model_section_error come first → done
//   when all are read back without a model: model_confirmed = 0 → done when telemetry shows it
//
// A robot takes parameters at rest only, so one that moves is waited for, for kPatience. Ends early when another fluid
// is named, the robot boots or the link breaks. Loop thread; lives as long as run() does.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <optional>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/station/commands/requests.hpp"
#include "server/station/models/fluid_naming.hpp"
#include "server/station/state/in_force.hpp"

namespace server::station {

// The robot at the other end, as the station knows it now.
class ModelRobot {
 public:
  virtual ~ModelRobot() = default;

  virtual const RobotState& state() const = 0;
  virtual const ParameterTable& parameters() const = 0;  // that it has reported in this connection
  virtual std::optional<bool> confirmation() const = 0;  // by its telemetry; none: not known
  virtual std::uint64_t latest_naming() const = 0;       // the number of the newest FluidNaming
  virtual boost::asio::awaitable<Result<CommandRecord>> submit(CommandRequest request) = 0;
};

class ModelExchange {
 public:
  static constexpr microseconds kPatience{30'000'000};  // with a robot that moves

  ModelExchange(runtime::Clock& clock, ModelRobot& robot, FluidNaming naming);

  boost::asio::awaitable<Result<void>> run();

 private:
  using Outcome = Result<void>;

  boost::asio::awaitable<Outcome> send_model();
  boost::asio::awaitable<Outcome> send_sections();
  boost::asio::awaitable<Outcome> send_as_assumed();
  boost::asio::awaitable<Outcome> take_back();
  boost::asio::awaitable<Outcome> set(std::string name, float value);
  boost::asio::awaitable<Outcome> read_back(std::string name, float value);
  boost::asio::awaitable<Outcome> wait_for_confirmation(bool is_confirmed);
  boost::asio::awaitable<Outcome> wait_for_rest();
  Outcome check_wanted() const;

  runtime::Clock& clock_;
  ModelRobot& robot_;
  const FluidNaming naming_;
  const std::int64_t deadline_us_;
};

// As far as the station knows; the robot itself may still coast.
bool is_at_rest(const RobotState& robot);

}  // namespace server::station
