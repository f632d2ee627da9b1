// Routes of the fault server, and faults as JSON.
#include "sim_robot/scenario/fault_requests.hpp"

#include <boost/asio/ip/address.hpp>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/field_list.hpp"

namespace sim_robot {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr std::string_view kPath = "/faults";
constexpr const char* kRoutes = "there are GET /faults, POST /faults and DELETE /faults/{id}";

// null: has no default, or is without end.
OrderedJson number(double value) { return std::isfinite(value) ? OrderedJson(value) : OrderedJson(nullptr); }

OrderedJson value_of(const base::Field& field) {
  if (field.must_be_given()) return nullptr;
  if (const double* value = std::get_if<double>(&field.value)) return number(*value);
  return std::visit([](const auto& value) { return OrderedJson(value); }, field.value);
}

OrderedJson describe(const base::Field& field) {
  OrderedJson json{{"key", field.key}, {"must_be_given", field.must_be_given()}, {"default", value_of(field)}};
  const bool is_number =
      std::holds_alternative<double>(field.value) || std::holds_alternative<std::uint64_t>(field.value);
  if (is_number) {
    json["minimum"] = number(field.range.minimum);
    json["maximum"] = number(field.range.maximum);
  }
  if (!field.names.empty()) json["one_of"] = field.names;
  json["what"] = field.what;
  return json;
}

OrderedJson known_faults(const FaultyRobot& robot) {
  OrderedJson all = OrderedJson::array();
  for (std::size_t i = 0; i < fault_types().size(); ++i) {
    Fault fault{.kind = static_cast<FaultKind>(i)};
    base::FieldList list;
    fields(list, fault);
    OrderedJson json{{"fault", fault_types()[i].name}, {"what", fault_types()[i].what}};
    json["is_in_this_run"] = why_not(fault.kind, robot.link != nullptr).empty();
    json["fields"] = OrderedJson::array();
    for (const base::Field& field : list.fields) json["fields"].push_back(describe(field));
    all.push_back(json);
  }
  return all;
}

double seconds(std::uint64_t us) { return static_cast<double>(us) * 1e-6; }

OrderedJson as_json(const FaultInForce& each) {
  Fault fault = each.fault;
  base::FieldList list;
  fields(list, fault);
  OrderedJson json{{"id", each.id}, {"fault", type_of(fault.kind).name}};
  for (const base::Field& field : list.fields) json[field.key] = value_of(field);
  json["since_s"] = seconds(each.since_us);
  json["until_s"] = each.until_us == FaultTimeline::kNever ? OrderedJson(nullptr) : OrderedJson(seconds(each.until_us));
  return json;
}

FaultAnswer list_faults(const FaultTimeline& faults, const FaultyRobot& robot) {
  const RobotLife& life = robot.life;
  OrderedJson json{{"robot_id", life.robot().config().robot_id}, {"time_s", seconds(life.true_us())}};
  json["robot_time_s"] = seconds(life.robot().robot_time_us());
  json["boots"] = life.boots();
  json["in_force"] = OrderedJson::array();
  for (const FaultInForce& each : faults.in_force()) json["in_force"].push_back(as_json(each));
  json["to_come"] = faults.to_come();
  json["known"] = known_faults(robot);
  return {200, json.dump() + "\n"};
}

FaultAnswer inject(const FaultRequest& request, FaultTimeline& faults, const FaultyRobot& robot) {
  if (!request.content_type.starts_with("application/json")) {
    return fault_problem(415, "not_json",
                         "content type is '" + request.content_type + "', allowed is application/json");
  }
  try {
    const Fault fault = parse_fault_json(request.body);
    if (const std::string reason = why_not(fault.kind, robot.link != nullptr); !reason.empty()) {
      return fault_problem(409, "not_in_this_run", reason);
    }
    const std::uint64_t id = faults.inject(fault, robot);
    return {201, OrderedJson{{"id", id}}.dump() + "\n"};
  } catch (const std::invalid_argument& error) {
    return fault_problem(400, "invalid_fault", error.what());
  }
}

FaultAnswer withdraw(const std::string& text, FaultTimeline& faults, const FaultyRobot& robot) {
  std::uint64_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc{} || end != text.data() + text.size()) {
    return fault_problem(400, "invalid_id", "'" + text + "' is not the number of a fault");
  }
  if (faults.withdraw(id, robot)) return {204, ""};
  return fault_problem(404, "no_such_fault", "no fault in force has the id " + text + "; GET /faults lists them");
}

// "localhost" or an address, with or without a port: what a page of another site cannot make a browser say.
bool is_plain_host(std::string host) {
  if (host.starts_with('[')) {
    const std::size_t end = host.find(']');
    if (end == std::string::npos) return false;
    host = host.substr(1, end - 1);
  } else {
    host = host.substr(0, host.find(':'));
  }
  boost::system::error_code error;
  boost::asio::ip::make_address(host, error);
  return host == "localhost" || !error;
}

}  // namespace

FaultAnswer fault_problem(int status, const std::string& reason, const std::string& detail) {
  const OrderedJson json{{"status", status}, {"reason", reason}, {"detail", detail}};
  return {status, json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace) + "\n"};
}

FaultAnswer answer(const FaultRequest& request, FaultTimeline& faults, const FaultyRobot& robot) {
  if (!is_plain_host(request.host) || !request.origin.empty()) {
    return fault_problem(403, "not_for_pages", "pages in a browser and other names of this host are refused");
  }
  const std::string path = request.target.substr(0, request.target.find('?'));
  const bool is_one = path.starts_with(std::string(kPath) + "/");
  if (path != kPath && !is_one) return fault_problem(404, "no_such_page", "no page '" + path + "'; " + kRoutes);
  if (is_one && request.method == "DELETE") return withdraw(path.substr(kPath.size() + 1), faults, robot);
  if (!is_one && request.method == "GET") return list_faults(faults, robot);
  if (!is_one && request.method == "POST") return inject(request, faults, robot);
  return fault_problem(405, "no_such_method", "no " + request.method + " of " + path + "; " + kRoutes);
}

}  // namespace sim_robot
