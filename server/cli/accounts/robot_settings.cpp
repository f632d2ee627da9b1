// Each change is one request that waits until the station has read the robot's answer back.
#include "server/cli/accounts/robot_settings.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <limits>
#include <stdexcept>

#include "server/analysis/control_json.hpp"
#include "server/cli/accounts/fluid.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/design/discretise.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/input.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {
namespace {

using nlohmann::json;
using Of = RobotSettingsCommand::Of;

constexpr std::size_t kPageParameters = 6;

class Robot {
 public:
  explicit Robot(const RobotSettingsCommand& options)
      : station_{options.data_dir}, path_{"/api/v1/robots/" + options.robot_id} {}

  json get(const char* what) const { return checked(station_.ask("GET", path_ + what)); }
  json command(const json& body) const { return post("/commands?wait=verified", body); }
  json post(const std::string& what, const json& body) const {
    return checked(station_.ask("POST", path_ + what, body));
  }

 private:
  static json checked(const StationAnswer& answer) {
    constexpr int kFirstProblem = 300;
    if (answer.status < kFirstProblem) return answer.body;
    throw std::runtime_error{answer.body.value("detail", fmt::format("the station answers {}", answer.status))};
  }

  StationClient station_;
  std::string path_;
};

// What became of a change: the exit status.
int print_outcome(const json& record, const std::string& what, bool as_json, std::ostream& out) {
  const bool is_verified = record.at("state") == "verified";
  if (as_json) {
    fmt::print(out, "{}\n", record.dump(2));
  } else if (is_verified) {
    fmt::print(out, "{}: verified, the robot says it back bit for bit\n", what);
  }
  return is_verified ? 0
                     : not_done(kNotVerified, fmt::format("{}: accepted by the robot, but not verified ({})", what,
                                                          record.at("reason").get<std::string>()));
}

std::string number(const json& value) { return value.is_null() ? "-" : value.dump(); }

void say_if_old(const json& known, std::ostream& out) {
  if (!known.at("is_current").get<bool>()) fmt::print(out, "Not current: what the robot said last\n");
}

int list_parameters(const Robot& robot, bool as_json, std::ostream& out) {
  const json known = robot.get("/parameters");
  if (as_json) {
    fmt::print(out, "{}\n", known.dump(2));
    return 0;
  }
  if (known.at("parameters").is_null()) {
    fmt::print(out, "Not known: the robot has not reported its parameters since the station started\n");
    return 0;
  }
  say_if_old(known, out);
  Table table{{"parameter", "value", "unit", "minimum", "maximum", "default", ""}};
  for (const json& one : known.at("parameters")) {
    const bool changed = one.at("changed").get<bool>(), bounds = one.at("bounds_motion").get<bool>();
    const char* remark = changed ? (bounds ? "changed, bounds motion" : "changed") : (bounds ? "bounds motion" : "");
    table.row({one.at("name").get<std::string>(), number(one.at("value")), one.at("unit").get<std::string>(),
               number(one.at("minimum")), number(one.at("maximum")), number(one.at("default")), remark});
  }
  table.write(out);
  return 0;
}

int set_parameter(const Robot& robot, const RobotSettingsCommand& options, std::ostream& out) {
  const auto sign = options.set.find('=');
  double value = 0;
  const char* const end = options.set.data() + options.set.size();
  const auto read = sign == std::string::npos ? std::from_chars_result{end, std::errc::invalid_argument}
                                              : std::from_chars(options.set.data() + sign + 1, end, value);
  if (sign == 0 || read.ec != std::errc{} || read.ptr != end) {
    throw UsageError{fmt::format("--set '{}' is not NAME=VALUE, such as duty_slew_per_s=5", options.set)};
  }
  json body{{"kind", "set_parameter"}, {"name", options.set.substr(0, sign)}, {"value", value}};
  if (options.confirm) body["confirm"] = true;
  return print_outcome(robot.command(body), fmt::format("{} = {}", options.set.substr(0, sign), value), options.json,
                       out);
}

// The station keeps what each page says.
int read_parameters(const Robot& robot, const RobotSettingsCommand& options, std::ostream& out) {
  std::size_t count = 1;
  for (std::size_t first = 0; first < count; first += kPageParameters) {
    const json record = robot.command({{"kind", "get_parameters"}, {"first_index", first}});
    if (record.at("state") != "verified") return print_outcome(record, "reading parameters", options.json, out);
    count = robot.get("/parameters").at("parameters").size();
  }
  return list_parameters(robot, options.json, out);
}

int show_controller(const Robot& robot, bool as_json, std::ostream& out) {
  const json known = robot.get("/controller");
  if (as_json) {
    fmt::print(out, "{}\n", known.dump(2));
    return 0;
  }
  const json& controller = known.at("controller");
  if (controller.is_null()) {
    fmt::print(out, "Not known: the robot has not reported its controller since the station started\n");
    return 0;
  }
  say_if_old(known, out);
  Table table{{"", ""}};
  for (const auto& [name, value] : controller.items()) table.row({name, value.dump()});
  table.write(out);
  return 0;
}

// What discretise printed; anything else is a controller in continuous time, which is discretised here.
json sections_in(const std::string& file, const Robot& robot) {
  const json content = read_json(file);
  const auto is_robots_controller = [&content] { return content.is_object() && content.contains("period_us"); };
  if (content.is_object() && content.contains("sections")) {
    json needed;
    for (const char* name : {"period_s", "dc_gain", "sections"}) {
      if (content.contains(name)) needed[name] = content[name];
    }
    return needed;
  }
  if (content.is_object() && content.contains("controller") && content.contains("told_at_us"))
    return content["controller"];
  if (is_robots_controller()) return content;
  Sampling sampling;
  const json in_force = robot.get("/controller").at("controller");
  constexpr double kUsPerS = 1e6;
  if (!in_force.is_null()) sampling.period_s = in_force.at("period_us").get<double>() / kUsPerS;
  const auto chosen = discretised(read(ControllerChoice{file}), sampling).chosen;
  const json made = json::parse(analysis::json_of(chosen).dump());
  return {{"period_s", made["period_s"]}, {"dc_gain", made["dc_gain"]}, {"sections", made["sections"]}};
}

// What the options say beside the controller itself.
void add_how(const RobotSettingsCommand& options, json& body) {
  if (options.duty_min) body["duty_min"] = *options.duty_min;
  if (options.duty_max) body["duty_max"] = *options.duty_max;
  if (!options.derivative_on.empty()) body["derivative_on"] = options.derivative_on;
  if (options.confirm) body["confirm"] = true;
}

int set_controller(const Robot& robot, const RobotSettingsCommand& options, std::ostream& out) {
  json body{{"kind", "set_controller"}, {"controller", sections_in(options.set, robot)}};
  add_how(options, body);
  const json record = robot.command(body);
  const json& id = record.at("arguments").at("controller").at("controller_id");
  return print_outcome(record, fmt::format("controller {}", id.dump()), options.json, out);
}

int push_design(const Robot& robot, const RobotSettingsCommand& options, std::ostream& out) {
  json body{{"design_id", *options.design}};
  add_how(options, body);
  const json pushed = robot.post("/controller", body);
  const std::string what = fmt::format("controller of design {}", *options.design);
  if (!options.json) return print_outcome(pushed.at("command"), what, false, out);
  fmt::print(out, "{}\n", pushed.dump(2));
  return pushed.at("verified").get<bool>() ? 0 : not_done(kNotVerified, what + ": not verified");
}

int restore_controller(const Robot& robot, const RobotSettingsCommand& options, std::ostream& out) {
  json body{{"kind", "restore_controller"}};
  if (options.confirm) body["confirm"] = true;
  return print_outcome(robot.command(body), "the controller before", options.json, out);
}

std::string model_words(const json& model) {
  const auto reason = model.at("reason").get<std::string>();
  const auto state = model.at("state").get<std::string>();
  const json& error = model.at("fit_error");
  const std::string fit = error.is_null() ? "" : fmt::format(", fit error {:.2g} %", 100 * error.get<double>());
  return state + fit + (reason.empty() ? "" : ": " + reason);
}

// Reads the robot's document, or the station's answer to a change: both have the two members.
int print_fluid(const json& known, bool as_json, std::ostream& out) {
  const json& fluid = known.at("fluid");
  if (as_json) {
    fmt::print(out, "{}\n", json{{"fluid", fluid}, {"model", known.at("model")}}.dump(2));
    return 0;
  }
  fmt::print(out, "fluid  {}\nmodel  {}\n",
             fluid.is_null() ? "not known: the strictest limits of all fluids hold" : fluid.get<std::string>(),
             model_words(known.at("model")));
  return 0;
}

// The limits of commands to the robot change with it, before the station answers.
int set_fluid(const Robot& robot, const RobotSettingsCommand& options, std::ostream& out) {
  const json fluid = options.is_not_known ? json(nullptr) : json(options.set);
  return print_fluid(robot.post("/fluid", {{"fluid", fluid}}), options.json, out);
}

// The person names the fluid of the model: the robot may be in another one.
int send_model(const Robot& robot, const RobotSettingsCommand& options, std::ostream& out) {
  const json sent = model_in_file(options.model, options.confirm_because);
  const json fluid = robot.post("/fluid", {{"fluid", options.set}}).at("fluid");
  const StationClient station{options.data_dir};
  const auto ask = [&station](const std::string& method, const std::string& target, const json& body) {
    return station.ask(method, target, body);
  };
  const json model = model_sent_to(ask, options.robot_id, {{"fluid", fluid}, {"model", sent}});
  print_fluid({{"fluid", fluid}, {"model", model}}, options.json, out);
  return model_has_arrived(model) ? 0 : not_done(kNotVerified, "the model: " + model_words(model));
}

CLI::App* offer(CLI::App& robot, RobotSettingsCommand& options, Of of, const char* name, const char* purpose) {
  CLI::App* sub = robot.add_subcommand(name, purpose);
  sub->add_option("robot_id", options.robot_id, "The robot")->required();
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->add_flag("--json", options.json, "As JSON");
  sub->callback([&options, of] { options.of = of; });
  return sub;
}

void offer_confirm(CLI::App& of, RobotSettingsCommand& options) {
  of.add_flag("--confirm", options.confirm, "Of a change that bounds motion otherwise: it is meant");
}

void offer_fluid(CLI::App& robot, RobotSettingsCommand& options) {
  CLI::App* fluid = offer(robot, options, Of::fluid, "fluid", "Show which fluid a robot is in, or say that it changed");
  CLI::Option* set =
      fluid->add_option("--set", options.set, "It is in this one, as `rheonaut fluid list` names it")->check(named());
  fluid->add_flag("--not-known", options.is_not_known, "Nobody knows its fluid: the strictest limits of all hold")
      ->excludes(set);
  CLI::Option* model = fluid
                           ->add_option("--model", options.model,
                                        "With --set: send it this model of that fluid, from `rheonaut estimator "
                                        "--json` (-: standard input); no other robot gets it")
                           ->check(named())
                           ->needs(set);
  fluid
      ->add_option("--confirm-because", options.confirm_because,
                   "Why it may take a model that is in grave doubt for that of its fluid; it stands in the audit")
      ->check(named())
      ->needs(model);
  fluid->footer("Example: rheonaut robot fluid sim-1 --set water --data lab");
}

}  // namespace

void add_options(CLI::App& robot, RobotSettingsCommand& options) {
  CLI::App* parameters = offer(robot, options, Of::parameters, "parameters", "List a robot's parameters, or set one");
  offer_confirm(*parameters, options);
  CLI::Option* set =
      parameters->add_option("--set", options.set, "NAME=VALUE: set this one and wait until it is verified");
  parameters->add_flag("--read", options.read_anew, "Ask the robot for all of them again, then list them")
      ->excludes(set);
  parameters->footer("Example: rheonaut robot parameters sim-1 --set duty_slew_per_s=5 --data lab");
  CLI::App* controller = offer(robot, options, Of::controller, "controller", "Show a robot's controller, or set one");
  offer_confirm(*controller, options);
  CLI::Option* file = controller->add_option(
      "--set", options.set, "What discretise --json printed, or a controller as of tune, which is discretised first");
  CLI::Option* design =
      controller->add_option("--design", options.design, "Set the controller that the station keeps under this number")
          ->check(whole(1, std::numeric_limits<std::int64_t>::max()))
          ->excludes(file);
  controller->add_flag("--restore", options.restore, "Back to the controller before the last change")
      ->excludes(file)
      ->excludes(design);
  controller->add_option("--duty-min", options.duty_min, "With --set or --design (default: as in force)")
      ->check(from_to(-1, 0));
  controller->add_option("--duty-max", options.duty_max, "With --set or --design (default: as in force)")
      ->check(from_to(0, 1));
  controller->add_option("--derivative-on", options.derivative_on, "error or measurement (default: as in force)")
      ->check(CLI::IsMember({"error", "measurement"}));
  controller->footer("Example: rheonaut robot controller sim-1 --set c.json --data lab");
  offer_fluid(robot, options);
}

int run(const RobotSettingsCommand& options, std::ostream& out) {
  const Robot robot{options};
  if (options.of == Of::parameters) {
    if (!options.set.empty()) return set_parameter(robot, options, out);
    return options.read_anew ? read_parameters(robot, options, out) : list_parameters(robot, options.json, out);
  }
  if (options.of == Of::fluid) {
    if (!options.model.empty()) return send_model(robot, options, out);
    const bool is_change = options.is_not_known || !options.set.empty();
    return is_change ? set_fluid(robot, options, out) : print_fluid(robot.get(""), options.json, out);
  }
  if (options.restore) return restore_controller(robot, options, out);
  if (options.design) return push_design(robot, options, out);
  return options.set.empty() ? show_controller(robot, options.json, out) : set_controller(robot, options, out);
}

}  // namespace server::cli
