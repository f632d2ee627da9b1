// One request for each robot, all at once, or one for all robots: each in the station's own lane for stops.
#include "server/cli/robots/stop.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>
#include <stdexcept>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/runtime/exceptions.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

// SAFETY: longer than the station itself takes for its answer (1.5 s for robots, 3 s for the disk), so that the answer
// is not missed; and an end, so that the person reads in time to use another switch.
constexpr microseconds kStopPatience{7'000'000};

constexpr microseconds kExplanationPatience{1'000'000};
constexpr std::size_t kMostExplained = 20;  // connections at once

constexpr const char* kNothingStopped = "NOTHING WAS STOPPED by this command: switch the robots off by hand; {}";
constexpr const char* kNotKnown = "IT IS NOT KNOWN whether anything was stopped: switch the robots off by hand; {}";

// SAFETY: a station that got the request may have stopped robots, also when its answer is lost or says that it failed.
[[noreturn]] void throw_unanswered(const StationAnswer& answer, const std::string& why) {
  const bool may_have_stopped = answer.may_have_arrived || answer.status >= 500;
  throw std::runtime_error{may_have_stopped ? fmt::format(kNotKnown, why) : fmt::format(kNothingStopped, why)};
}

// What became of the stop of one robot.
struct StopOutcome {
  std::string robot_id;
  bool is_confirmed = false;
  json record;      // of the command; null when there is none
  std::string why;  // of one that is not confirmed; empty while it is not known
};

// SAFETY: only what the robot itself has acknowledged counts as a stop; sent or queued is not enough.
bool is_confirmed(const json& record) {
  const json state = record.value("state", json());
  return state == "acknowledged" || state == "verified";
}

StopOutcome outcome_of(std::string robot_id, const json& record) {
  return {std::move(robot_id), is_confirmed(record), record, ""};
}

// Why a robot whose stop the station holds has not confirmed it.
// SAFETY: asked when the person has read the outcome, for it takes up to kExplanationPatience.
void explain(const StationClient& station, std::vector<StopOutcome>& outcomes) {
  std::vector<StopOutcome*> open;
  std::vector<StationRequest> requests;
  for (StopOutcome& one : outcomes) {
    if (one.is_confirmed || !one.why.empty()) continue;
    one.why = "it has not answered; the stop is kept";
    if (open.size() == kMostExplained) continue;
    open.push_back(&one);
    requests.push_back({"GET", "/api/v1/robots/" + one.robot_id});
  }
  const std::vector<StationAnswer> answers = station.ask_at_once(requests, kExplanationPatience);
  for (std::size_t i = 0; i < open.size(); ++i) {
    const json& robot = answers[i].body;
    const bool is_known = robot.is_object() && robot.contains("link");
    open[i]->why = is_known && robot.at("link") != "connected"
                       ? "it is not connected; the stop is kept and is sent first when it connects"
                       : "it has not answered; the stop is repeated each second";
  }
}

std::string text_in(const json& object, const char* name) {
  const json value = object.value(name, json());
  return value.is_string() ? value.get<std::string>() : "?";
}

std::string refusal_in(const StationAnswer& answer) {
  if (answer.status == 0) return answer.text;
  const std::string detail = answer.body.is_object() ? answer.body.value("detail", std::string{}) : std::string{};
  if (answer.body.is_object() && answer.body.value("reason", json()) == "not_stored") return detail;
  return fmt::format("the station refused: {}", detail.empty() ? fmt::format("status {}", answer.status) : detail);
}

std::vector<StopOutcome> stop_each(const StationClient& station, std::vector<std::string> robots) {
  std::ranges::sort(robots);
  robots.erase(std::ranges::unique(robots).begin(), robots.end());
  std::vector<StationRequest> requests;
  for (const std::string& id : robots) requests.push_back({"POST", "/api/v1/robots/" + id + "/emergency-stop"});
  const std::vector<StationAnswer> answers = station.ask_at_once(requests, kStopPatience);
  const auto is_silent = [](const StationAnswer& answer) { return answer.status == 0; };
  if (std::ranges::all_of(answers, is_silent)) {
    const auto arrived = std::ranges::find_if(answers, &StationAnswer::may_have_arrived);
    throw_unanswered(arrived == answers.end() ? answers.front() : *arrived, answers.front().text);
  }
  std::vector<StopOutcome> outcomes;
  for (std::size_t i = 0; i < robots.size(); ++i) {
    const json& body = answers[i].body;
    if (body.is_object() && body.contains("state")) {
      outcomes.push_back(outcome_of(robots[i], body));
    } else {
      outcomes.push_back({robots[i], false, nullptr, refusal_in(answers[i])});
    }
  }
  return outcomes;
}

std::vector<StopOutcome> stop_all(const StationClient& station) {
  const StationAnswer answer = station.ask_at_once({{"POST", "/api/v1/emergency-stop"}}, kStopPatience).front();
  if (!answer.body.is_object() || !answer.body.contains("commands")) {
    throw_unanswered(answer, refusal_in(answer));
  }
  // Whatever is missing here, of a station of another version, is not confirmed.
  std::vector<StopOutcome> outcomes;
  for (const json& record : answer.body.at("commands"))
    outcomes.push_back(outcome_of(text_in(record, "robot_id"), record));
  if (answer.body.value("reason", json()) == "not_stored") {
    for (StopOutcome& one : outcomes) {
      if (!one.is_confirmed) one.why = refusal_in(answer);
    }
  }
  const json summary = answer.body.value("summary", json::object());
  for (const json& one : summary.value("not_acknowledged", json::array())) {
    if (text_in(one, "outcome") != "failed") continue;
    outcomes.push_back({text_in(one, "robot_id"), false, nullptr, "the station failed; its log says why"});
  }
  const std::int64_t left_out = summary.value("left_out", std::int64_t{0});
  const auto missing = summary.value("robots", std::int64_t{0}) - left_out - std::ssize(outcomes);
  if (missing > 0) outcomes.push_back({fmt::format("{} more", missing), false, nullptr, "the page names them"});
  return outcomes;
}

void write_as_json(std::ostream& out, const std::vector<StopOutcome>& outcomes, std::int64_t answered_after_us) {
  nlohmann::ordered_json answer;
  answer["confirmed"] = std::ranges::count_if(outcomes, &StopOutcome::is_confirmed);
  answer["not_confirmed"] = std::ranges::count_if(outcomes, [](const auto& one) { return !one.is_confirmed; });
  answer["answered_after_us"] = answered_after_us;
  answer["robots"] = nlohmann::ordered_json::array();
  for (const StopOutcome& one : outcomes) {
    nlohmann::ordered_json robot{{"robot_id", one.robot_id}, {"confirmed", one.is_confirmed}};
    for (const char* name : {"state", "acknowledged_after_us", "emergency_id", "command_id"}) {
      robot[name] = one.record.is_object() ? one.record.value(name, json()) : json();
    }
    robot["detail"] = one.is_confirmed ? json() : json(one.why);
    answer["robots"].push_back(robot);
  }
  write_json(out, answer);
}

std::string after_text(const json& record) {
  constexpr double kUsPerMs = 1000;
  const json after_us = record.value("acknowledged_after_us", json());
  return after_us.is_number() ? fmt::format(" after {:.1f} ms", after_us.get<double>() / kUsPerMs) : "";
}

// Those that are not confirmed come last, where the person looks first.
void write_as_text(std::ostream& out, const std::vector<StopOutcome>& outcomes, std::int64_t answered_after_us) {
  std::size_t width = 0;
  for (const StopOutcome& one : outcomes) width = std::max(width, one.robot_id.size());
  for (const StopOutcome& one : outcomes) {
    const std::string said = one.is_confirmed  ? fmt::format("stopped: the robot confirmed{}", after_text(one.record))
                             : one.why.empty() ? "NOT CONFIRMED"
                                               : "NOT CONFIRMED: " + one_line(one.why);
    fmt::print(out, "{:<{}}  {}\n", one_line(one.robot_id), width, said);
  }
  fmt::print(out, "{} of {} robots confirmed; the station answered after {:.0f} ms\n",
             std::ranges::count_if(outcomes, &StopOutcome::is_confirmed), outcomes.size(),
             static_cast<double>(answered_after_us) / 1000);
  out.flush();
}

// Writes the reasons that were not known yet.
void write_reasons(std::ostream& out, const std::vector<StopOutcome>& before, const std::vector<StopOutcome>& now) {
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (now[i].is_confirmed || !before[i].why.empty()) continue;
    fmt::print(out, "{}: {}\n", one_line(now[i].robot_id), one_line(now[i].why));
  }
}

int exit_code_of(const std::vector<StopOutcome>& outcomes) {
  if (outcomes.empty()) return not_done(kNotConfirmed, "NOTHING WAS STOPPED: this station knows no robot");
  const auto open = std::ranges::count_if(outcomes, std::not_fn(&StopOutcome::is_confirmed));
  if (open == 0) return 0;
  return not_done(kNotConfirmed, fmt::format("NOT CONFIRMED by {} of {} robots: switch off by hand those that move",
                                             open, outcomes.size()));
}

StationClient client_of(const std::filesystem::path& data_dir) {
  try {
    return StationClient{data_dir};
  } catch (const std::exception& error) {
    throw std::runtime_error{fmt::format(kNothingStopped, runtime::text_of(error))};
  }
}

}  // namespace

void add_options(CLI::App& command, StopCommand& options) {
  CLI::Option* robots =
      command.add_option("robot_id", options.robots, "The robots; without any, all robots of the station")
          ->check(named());
  command.add_flag("--all", options.is_all, "All robots of the station")->excludes(robots);
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  add_json_flag(command, options.form);
  command.footer(
      "The motor stays off until somebody resets the emergency (clear_emergency). Everybody may stop.\n"
      "Exit status 5: a robot has not confirmed; 1: the station does not answer. Then switch the robots off by hand.\n"
      "Of the service: sudo -u rheonaut rheonaut stop --data /var/lib/rheonaut\n"
      "Example: rheonaut stop --data lab\n"
      "Example: rheonaut stop sim-1 sim-2 --data lab");
}

int run(const StopCommand& options, std::ostream& out) {
  boost::asio::io_context clocks_loop;
  const runtime::SystemClock clock{clocks_loop};
  const std::int64_t begun_us = clock.steady_us();
  const StationClient station = client_of(options.data_dir);
  std::vector<StopOutcome> outcomes = options.robots.empty() ? stop_all(station) : stop_each(station, options.robots);
  const std::int64_t answered_after_us = clock.steady_us() - begun_us;
  std::ranges::sort(outcomes, {}, [](const StopOutcome& one) { return std::pair{!one.is_confirmed, one.robot_id}; });
  if (!options.form.is_json) write_as_text(out, outcomes, answered_after_us);
  const int exit_code = exit_code_of(outcomes);  // said before it looks for reasons
  const std::vector<StopOutcome> written = outcomes;
  explain(station, outcomes);
  if (options.form.is_json) {
    write_as_json(out, outcomes, answered_after_us);
  } else {
    write_reasons(out, written, outcomes);
  }
  return exit_code;
}

}  // namespace server::cli
