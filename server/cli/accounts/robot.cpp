// One subcommand an act.
#include "server/cli/accounts/robot.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <tuple>

#include "server/cli/accounts/account_access.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

CLI::App* offer(CLI::App& command, RobotCommand& options, RobotCommand::Act act, const char* name,
                const char* purpose) {
  CLI::App* sub = command.add_subcommand(name, purpose);
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->add_flag("--json", options.json, "As JSON");
  sub->callback([&options, act] { options.act = act; });
  return sub;
}

CLI::Validator robot_id() {
  const auto refuse = [](std::string& id) -> std::string {
    constexpr std::size_t kMaxBytes = 31;
    constexpr auto kAllowed = "abcdefghijklmnopqrstuvwxyz0123456789_-";
    if (!id.empty() && id.size() <= kMaxBytes && id.find_first_not_of(kAllowed) == std::string::npos) return {};
    return fmt::format("must be 1 to {} characters of [a-z0-9_-], is '{}'", kMaxBytes, id);
  };
  return CLI::Validator{refuse, ""};
}

int list_robots(const nlohmann::json& robots, bool as_json, std::ostream& out) {
  if (as_json) {
    fmt::print(out, "{}\n", robots.dump(2));
    return 0;
  }
  if (robots.empty()) fmt::print(out, "No robot is enrolled\n");
  for (const auto& robot : robots) {
    const std::string revoked = time_text(robot.at("revoked_at_us"));
    const std::string retired = time_text(robot.at("retired_at_us"));
    fmt::print(out, "{:<31}  {}  enrolled {} by {}{}{}\n", robot.at("robot_id").get<std::string>(),
               robot.at("has_token").get<bool>() ? "token   " : "no token", time_text(robot.at("enrolled_at_us")),
               robot.at("enrolled_by").get<std::string>(), revoked.empty() ? "" : ", revoked " + revoked,
               retired.empty() ? "" : ", retired " + retired);
  }
  return 0;
}

int enrol(const RobotCommand& options, std::ostream& out) {
  const nlohmann::json made = AccountAccess{options.data_dir, AccountAccess::Missing::make}.enrol(options.robot_id);
  if (options.json) {
    fmt::print(out, "{}\n", made.dump(2));
    return 0;
  }
  const auto token = made.at("secret").get<std::string>();
  fmt::print(out,
             "Robot {0} is enrolled. Its token, which is shown only now:\n\n  {1}\n\n"
             "Firmware: the first two values of kSecrets in robot_fw/esp8266/secrets.hpp\n"
             "  \"{0}\",\n  \"{1}\",\n"
             "Simulated robot: rheonaut-sim --id {0} --token {1}\n",
             options.robot_id, token);
  return 0;
}

int revoke(AccountAccess& accounts, const RobotCommand& options, std::ostream& out) {
  const std::optional<std::uint64_t> given_up = accounts.revoke_robot(options.robot_id);
  if (options.json) {
    nlohmann::json answer{{"robot_id", options.robot_id}, {"result", "revoked"}, {"samples_given_up", nullptr}};
    if (given_up) answer["samples_given_up"] = *given_up;
    fmt::print(out, "{}\n", answer.dump(2));
  } else if (given_up) {
    fmt::print(out, "Robot {} was revoked; {} samples that it has not sent are given up\n", options.robot_id,
               *given_up);
  } else {
    fmt::print(out, "Robot {} was revoked; samples that it has not sent are given up when the station runs\n",
               options.robot_id);
  }
  return 0;
}

}  // namespace

void add_options(CLI::App& command, RobotCommand& options) {
  command.require_subcommand(1);
  auto* enrol = offer(command, options, RobotCommand::Act::enrol, "enrol",
                      "Give a robot a token and print it: it is shown only now");
  enrol->alias("enroll");  // as it was spelled before
  enrol->add_option("robot_id", options.robot_id, "1 to 31 characters of [a-z0-9_-]")->required()->check(robot_id());
  enrol->footer("Example: rheonaut robot enrol rheo-1 --data lab");
  offer(command, options, RobotCommand::Act::list, "list", "List the robots that may or might connect");
  constexpr std::tuple<RobotCommand::Act, const char*, const char*> kOfOne[] = {
      {RobotCommand::Act::revoke, "revoke",
       "Refuse a robot from now on, end its connection, give up what it has not sent"},
      {RobotCommand::Act::retire, "retire", "Leave a robot out of the stop of all robots while it is not connected"},
      {RobotCommand::Act::unretire, "unretire", "Put a retired robot back into use"}};
  for (const auto& [act, name, purpose] : kOfOne) {
    offer(command, options, act, name, purpose)
        ->add_option("robot_id", options.robot_id, "The robot")
        ->required()
        ->check(robot_id());
  }
  add_options(command, options.settings);
  add_options(command, options.reservations);
  command.footer("Example: rheonaut robot list --data lab");
}

int run(const RobotCommand& options, std::ostream& out) {
  if (options.settings.of != RobotSettingsCommand::Of::nothing) return run(options.settings, out);
  if (options.reservations.act != RobotReservationCommand::Act::nothing) return run(options.reservations, out);
  if (options.act == RobotCommand::Act::enrol) return enrol(options, out);
  AccountAccess accounts{options.data_dir, AccountAccess::Missing::refuse};
  if (options.act == RobotCommand::Act::list) return list_robots(accounts.enrolments(), options.json, out);
  if (options.act == RobotCommand::Act::revoke) return revoke(accounts, options, out);
  accounts.set_retired(options.robot_id, options.act == RobotCommand::Act::retire);
  const char* done = options.act == RobotCommand::Act::retire ? "retired" : "put back into use";
  if (options.json) {
    fmt::print(out, "{}\n", nlohmann::json{{"robot_id", options.robot_id}, {"result", done}}.dump(2));
  } else {
    fmt::print(out, "Robot {} was {}\n", options.robot_id, done);
  }
  return 0;
}

}  // namespace server::cli
