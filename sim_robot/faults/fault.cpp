// Reads faults from JSON, and says what is wrong with them.
#include "sim_robot/faults/fault.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "base/field_reader.hpp"
#include "base/invalid_argument.hpp"
#include "base/json_table.hpp"
#include "sim_robot/robot/simulated_robot.hpp"

namespace sim_robot {
namespace {

using Json = nlohmann::json;

// Objects of texts, numbers and true or false alone; a key that comes twice is refused.
toml::table flat_table(std::string_view json) {
  std::set<std::string> seen;
  const auto watch = [&seen](int depth, Json::parse_event_t event, Json& parsed) {
    const bool is_deep =
        depth > 0 && (event == Json::parse_event_t::object_start || event == Json::parse_event_t::array_start);
    if (is_deep) base::throw_invalid("a fault is one object of texts, numbers, true and false, without objects in it");
    if (event == Json::parse_event_t::key && !seen.insert(parsed.get<std::string>()).second) {
      base::throw_invalid(parsed.get<std::string>(), ": is given twice");
    }
    return true;
  };
  const Json given = Json::parse(json, watch, false);
  if (given.is_discarded()) base::throw_invalid("this is not JSON; a fault is {\"fault\":\"electrode_offset\",…}");
  if (!given.is_object()) base::throw_invalid("a fault is an object, {\"fault\":\"electrode_offset\",…}");
  return base::table_of(given);
}

}  // namespace

Fault parse_fault_json(std::string_view json) {
  const toml::table table = flat_table(json);
  const std::string no_origin;
  base::FieldReader reader{table, no_origin};
  Fault fault;
  fields_with_kind(reader, fault);
  reader.finish();
  return fault;
}

namespace {

void check_flow(const Fault& fault, const WorldConfig& world) {
  const char* const name = type_of(fault.kind).name;
  if (!world.vessel) base::throw_invalid(name, ": there is no vessel; give the world a [vessel]");
  if (fault.kind == FaultKind::mean_flow) return;
  if (fault.pump == PumpSetting::off && fault.mean_flow_m_s != 0) {
    base::throw_invalid("mean_flow_m_s is ", fault.mean_flow_m_s, ", but pump is off");
  }
  const double most_m_s = kMostFlowM3S / tube_area_m2(world.vessel->large_diameter_m);
  if (!(std::abs(fault.mean_flow_m_s) <= most_m_s)) {
    base::throw_invalid("mean_flow_m_s: is ", fault.mean_flow_m_s, ", the pump reaches ", most_m_s, " in this vessel");
  }
}

}  // namespace

void check(const Fault& fault, const WorldConfig& world) {
  const FaultType& type = type_of(fault.kind);
  if (type.target == FaultTarget::accelerometer && !world.imu) {
    base::throw_invalid(type.name, ": the perfect sensor has no faults; leave out preset = \"perfect\"");
  }
  if (type.target == FaultTarget::pump) check_flow(fault, world);
  if (fault.kind == FaultKind::pour_glucose) check(fault.patch);
  const bool is_clock = fault.kind == FaultKind::clock_drift || fault.kind == FaultKind::clock_jump;
  const double by = fault.kind == FaultKind::clock_drift ? fault.drift_ppm : fault.jump_s;
  if (is_clock && !std::isfinite(by)) base::throw_invalid(type.name, ": ", by, " is no number to change a clock by");
  if (!(fault.for_s > 0)) base::throw_invalid("for_s must be positive, is ", fault.for_s);
}

}  // namespace sim_robot
