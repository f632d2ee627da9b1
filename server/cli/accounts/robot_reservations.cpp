// Each is one request to the station, in the name of its own token.
#include "server/cli/accounts/robot_reservations.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "server/cli/accounts/account_access.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {
namespace {

using nlohmann::json;
using Act = RobotReservationCommand::Act;

constexpr std::int64_t kLongest_s = 7 * 86'400;

json ask(const RobotReservationCommand& options, const std::string& method, const std::string& target,
         const json& body = nullptr) {
  return asked(StationClient{options.data_dir}.ask(method, target, body));
}

CLI::App* offer(CLI::App& robot, RobotReservationCommand& options, Act act, const char* name, const char* purpose) {
  CLI::App* sub = robot.add_subcommand(name, purpose);
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->add_flag("--json", options.json, "As JSON");
  sub->callback([&options, act] { options.act = act; });
  return sub;
}

CLI::Validator duration() {
  const auto refuse = [](std::string& text) -> std::string {
    const auto seconds = seconds_of(text);
    if (seconds && *seconds <= kLongest_s) return {};
    return fmt::format("must be a duration of at most 7d, such as 2h or 1h30min, is '{}'", text);
  };
  return CLI::Validator{refuse, ""};
}

CLI::Validator utc_time() {
  const auto refuse = [](std::string& text) -> std::string {
    if (utc_us_of(text)) return {};
    return fmt::format("must be a time in UTC such as 2026-11-26T09:00Z, is '{}'", text);
  };
  return CLI::Validator{refuse, ""};
}

void write_reservations(std::ostream& out, const std::vector<json>& reservations) {
  Table table{{"id", "<robot", "<for", "<from (UTC)", "<until (UTC)", "<purpose", "<"}};
  for (const json& one : reservations) {
    const std::string cancelled = time_text(one.at("cancelled_at_us"));
    table.row({fmt::format("{}", one.at("reservation_id").get<std::int64_t>()), one.at("robot_id"), one.at("holder"),
               time_text(one.at("from_us")), time_text(one.at("until_us")), one.at("purpose"),
               cancelled.empty() ? "" : "cancelled " + cancelled});
  }
  table.write(out);
}

int reserve(const RobotReservationCommand& options, std::ostream& out) {
  json body{{"for_s", options.for_s}};
  if (options.from_us) body["from_us"] = *options.from_us;
  if (!options.purpose.empty()) body["purpose"] = options.purpose;
  if (!options.holder.empty()) body["holder"] = options.holder;
  const json made = ask(options, "POST", fmt::format("/api/v1/robots/{}/reservations", options.robot_id), body);
  if (options.json) {
    fmt::print(out, "{}\n", made.dump(2));
  } else {
    fmt::print(out, "Reservation {}: robot {} is reserved for {} from {} until {} UTC\n",
               made.at("reservation_id").get<std::int64_t>(), options.robot_id, made.at("holder").get<std::string>(),
               time_text(made.at("from_us")), time_text(made.at("until_us")));
  }
  return 0;
}

int list(const RobotReservationCommand& options, std::ostream& out) {
  std::string target = "/api/v1/reservations?limit=1000";
  if (!options.with_over) target += "&over=false";
  if (!options.robot_id.empty()) target += "&robot_id=" + options.robot_id;
  auto found = ask(options, "GET", target).at("reservations").get<std::vector<json>>();
  std::ranges::sort(found, {}, [](const json& one) {
    return std::pair{one.at("from_us").get<std::int64_t>(), one.at("robot_id").get<std::string>()};
  });
  if (options.json) {
    fmt::print(out, "{}\n", json(found).dump(2));
  } else if (found.empty()) {
    fmt::print(out, "No robot is reserved\n");
  } else {
    write_reservations(out, found);
  }
  return 0;
}

int cancel(const RobotReservationCommand& options, std::ostream& out) {
  const json cancelled = ask(options, "POST", fmt::format("/api/v1/reservations/{}/cancel", options.reservation));
  if (options.json) {
    fmt::print(out, "{}\n", cancelled.dump(2));
  } else {
    fmt::print(out, "Reservation {} of robot {} is cancelled\n", options.reservation,
               cancelled.at("robot_id").get<std::string>());
  }
  return 0;
}

// A number at the beginning of the text, which it is taken from.
std::optional<std::int64_t> take_number(std::string_view& text, std::int64_t most) {
  std::int64_t number = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
  if (read.ec != std::errc{} || number < 0 || number > most) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(read.ptr - text.data()));
  return number;
}

bool take_mark(std::string_view& text, std::string_view mark) {
  if (!text.starts_with(mark)) return false;
  text.remove_prefix(mark.size());
  return true;
}

}  // namespace

std::optional<std::int64_t> seconds_of(const std::string& duration) {
  constexpr std::array<std::pair<std::string_view, std::int64_t>, 4> kUnits{
      {{"d", 86'400}, {"h", 3600}, {"min", 60}, {"s", 1}}};
  constexpr std::int64_t kMost = 1'000'000;
  std::string_view rest = duration;
  std::int64_t sum_s = 0;
  for (const auto& [unit, seconds] : kUnits) {
    std::string_view tried = rest;
    const auto number = take_number(tried, kMost);
    if (!number || !take_mark(tried, unit)) continue;
    sum_s += *number * seconds;
    rest = tried;
  }
  return rest.empty() && sum_s > 0 ? std::optional{sum_s} : std::nullopt;
}

std::optional<std::int64_t> utc_us_of(const std::string& time) {
  std::string_view rest = time;
  std::array<std::int64_t, 6> parts{};
  constexpr std::array<std::int64_t, 6> kMost{9999, 12, 31, 23, 59, 59};
  constexpr std::array<std::string_view, 6> kBefore{"", "-", "-", "T", ":", ":"};
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const bool may_be_left_out = i + 1 == parts.size() && rest == "Z";
    if (may_be_left_out) break;
    const auto number = take_mark(rest, kBefore[i]) ? take_number(rest, kMost[i]) : std::nullopt;
    if (!number) return std::nullopt;
    parts[i] = *number;
  }
  const std::chrono::year_month_day date{std::chrono::year{static_cast<int>(parts[0])},
                                         std::chrono::month{static_cast<unsigned>(parts[1])},
                                         std::chrono::day{static_cast<unsigned>(parts[2])}};
  if (rest != "Z" || !date.ok()) return std::nullopt;
  const auto at = std::chrono::sys_days{date} + std::chrono::hours{parts[3]} + std::chrono::minutes{parts[4]} +
                  std::chrono::seconds{parts[5]};
  return std::chrono::duration_cast<std::chrono::microseconds>(at.time_since_epoch()).count();
}

void add_options(CLI::App& robot, RobotReservationCommand& options) {
  auto* reserve = offer(robot, options, Act::reserve, "reserve",
                        "Keep a robot of the running station for one account, for a time slot");
  reserve->add_option("robot", options.robot_id, "The robot")->required()->check(named());
  reserve
      ->add_option_function<std::string>(
          "--for", [&options](const std::string& text) { options.for_s = seconds_of(text).value_or(0); },
          "How long: e.g. 2h, 1h30min, 1d; at most 7d")
      ->required()
      ->check(duration());
  reserve
      ->add_option_function<std::string>(
          "--from", [&options](const std::string& text) { options.from_us = utc_us_of(text); },
          "When it begins, in UTC: e.g. 2026-11-26T09:00Z (default: now)")
      ->check(utc_time());
  reserve->add_option("--purpose", options.purpose, "What for, for the others to read");
  reserve
      ->add_option("--holder", options.holder, "For whom: user:NAME or token:NAME (default: the station's own token)")
      ->check(named());
  reserve->footer("Example: rheonaut robot reserve sim-1 --for 2h --holder user:anna --data lab");
  auto* list = offer(robot, options, Act::list, "reservations", "List the reservations of robots that are not over");
  list->add_option("robot", options.robot_id, "Only those of this robot")->check(named());
  list->add_flag("--all", options.with_over, "Also those that are over or cancelled");
  offer(robot, options, Act::cancel, "cancel-reservation", "Cancel a reservation")
      ->add_option("reservation", options.reservation, "Its number, as `rheonaut robot reservations` shows it")
      ->required()
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
}

int run(const RobotReservationCommand& options, std::ostream& out) {
  if (options.act == Act::reserve) return reserve(options, out);
  if (options.act == Act::cancel) return cancel(options, out);
  return list(options, out);
}

}  // namespace server::cli
