// One subcommand an act, each one request to the station.
#include "server/cli/accounts/fluid.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <stdexcept>
#include <vector>

#include "server/cli/accounts/account_access.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/input.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

using nlohmann::json;
constexpr int kDone = 200;
constexpr int kModelLookMs = 50, kModelPatienceMs = 37'000;  // the station answers after 3 s, and tries for 30 s

CLI::App* offer(CLI::App& command, FluidCommand& options, FluidCommand::Act act, const char* name,
                const char* purpose) {
  CLI::App* sub = command.add_subcommand(name, purpose);
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->callback([&options, act] { options.act = act; });
  return sub;
}

json ask(const FluidCommand& options, const std::string& method, const std::string& target,
         const json& body = nullptr) {
  const StationAnswer answer = StationClient{options.data_dir}.ask(method, target, body);
  if (answer.status == kDone) return answer.body;
  throw std::runtime_error{fmt::format("the station refused: {}", answer.body.value("detail", "no reason"))};
}

int list(const FluidCommand& options, std::ostream& out) {
  const json fluids = ask(options, "GET", "/api/v1/fluids").at("fluids");
  if (options.json) fmt::print(out, "{}\n", fluids.dump(2));
  for (const json& fluid : options.json ? json::array() : fluids) {
    const json& model = fluid.at("model");
    const std::string words =
        model.is_null()
            ? "no model"
            : fmt::format("model with a fit error of {:.2g} %, set {} by {}", 100 * model.at("fit_error").get<double>(),
                          time_text(model.at("set_at_us")), model.at("set_by").get<std::string>());
    fmt::print(out, "{:<20}  {}\n", fluid.at("fluid").get<std::string>(), words);
  }
  return 0;
}

int change(const FluidCommand& options, std::ostream& out) {
  const bool removes = options.act == FluidCommand::Act::remove_model;
  const std::string path = path_of_fluid_model(options.fluid);
  const json answer = removes ? ask(options, "POST", path + "/remove", json::object())
                              : ask(options, "POST", path, model_in_file(options.file, options.confirm_because));
  if (options.json) {
    fmt::print(out, "{}\n", answer.dump(2));
    return 0;
  }
  fmt::print(out, "The fluid {} has {}\n", answer.at("fluid").get<std::string>(),
             removes ? "no model any more" : "this model from now on");
  const json because = removes ? json() : answer.at("model").at("assumed_because");
  if (because.is_string()) {
    fmt::print(out,
               "Robots are sent it as assumed only, since it is in doubt: {}. Identify it anew; or confirm it with "
               "--confirm-because and a reason\n",
               because.get<std::string>());
  }
  const auto robots = answer.at("robots_not_updated").get<std::vector<std::string>>();
  if (!robots.empty()) {
    fmt::print(out, "Not sent to the robots in it before their fluid is named again: {}\n", fmt::join(robots, ", "));
  }
  return 0;
}

}  // namespace

json model_in_file(const std::filesystem::path& file, const std::string& confirm_because) {
  json model = read_json(file.string());
  if (!model.is_object()) {
    throw std::runtime_error{
        fmt::format("'{}' is not a JSON object, as `rheonaut estimator --json` writes it", file.string())};
  }
  if (!confirm_because.empty()) model["confirmed_because"] = confirm_because;
  return model;
}

json model_sent_to(const AskStation& ask, const std::string& robot_id, const json& body) {
  const std::string robot = "/api/v1/robots/" + robot_id;
  json now = asked(ask("POST", robot + "/model", body)).at("model");
  BusyWait busy{{.pause = std::chrono::milliseconds{kModelLookMs}}};
  for (int looks = 0; now.at("state") == "sending" && looks < kModelPatienceMs / kModelLookMs; ++looks) {
    busy.pause();
    StationAnswer answer = ask("GET", robot, nullptr);
    if (!busy.is_busy(answer)) now = asked(std::move(answer)).at("model");
  }
  return now;
}

bool model_has_arrived(const json& model) {
  const json& state = model.at("state");
  return (state == "confirmed" || state == "assumed") && model.at("fit_error").is_number();
}

std::string path_of_fluid_model(const std::string& fluid) {
  std::string encoded;
  for (const char c : fluid) encoded += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  return "/api/v1/fluids/" + encoded + "/model";
}

void add_options(CLI::App& command, FluidCommand& options) {
  command.require_subcommand(1);
  offer(command, options, FluidCommand::Act::list, "list",
        "List the fluids that robots may be in, and which have a model")
      ->add_flag("--json", options.json, "As JSON");
  auto* model =
      offer(command, options, FluidCommand::Act::model, "model", "Give a fluid the model that is sent to robots in it");
  model->add_option("fluid", options.fluid, "The fluid, as `rheonaut fluid list` names it")->required()->check(named());
  model->add_option("file", options.file, "The model, from `rheonaut estimator --json`; -: standard input")
      ->required()
      ->check(named());
  model
      ->add_option("--confirm-because", options.confirm_because,
                   "Why robots may take a model that is in grave doubt for that of the fluid; it stands in the audit")
      ->check(named());
  model->add_flag("--json", options.json, "As JSON");
  model->footer("Example: rheonaut fluid model water model.json --data lab");
  auto* remove = offer(command, options, FluidCommand::Act::remove_model, "remove-model", "Take a fluid's model away");
  remove->add_option("fluid", options.fluid, "The fluid")->required()->check(named());
  remove->add_flag("--json", options.json, "As JSON");
  command.footer("Example: rheonaut fluid list --data lab");
}

int run(const FluidCommand& options, std::ostream& out) {
  return options.act == FluidCommand::Act::list ? list(options, out) : change(options, out);
}

}  // namespace server::cli
