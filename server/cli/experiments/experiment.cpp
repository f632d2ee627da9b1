// One subcommand an act. Who waits asks again and again, which is also the sign of life that an experiment needs.
#include "server/cli/experiments/experiment.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <cstdio>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "server/cli/accounts/account_access.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/experiments/profile_file.hpp"
#include "server/cli/terminal/keys.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

constexpr int kWatch_ms = 60;  // between two signs of life; each is as old as the one before, and counts for 400 ms
constexpr int kDone = 200, kConflict = 409;
constexpr const char* kExperiments = "/api/v1/experiments";

CLI::App* offer(CLI::App& command, ExperimentCommand& options, ExperimentCommand::Act act, const char* name,
                const char* purpose) {
  CLI::App* sub = command.add_subcommand(name, purpose);
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->add_flag("--json", options.json, "As JSON");
  sub->callback([&options, act] { options.act = act; });
  return sub;
}

CLI::App* offer_one(CLI::App& command, ExperimentCommand& options, ExperimentCommand::Act act, const char* name,
                    const char* purpose) {
  CLI::App* sub = offer(command, options, act, name, purpose);
  sub->add_option("experiment", options.experiment, "Its number, as `rheonaut experiment list` shows it")
      ->required()
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  return sub;
}

json accepted(const StationAnswer& answer) {
  if (answer.status >= 200 && answer.status < 300) return answer.body;
  throw std::runtime_error{fmt::format("the station refused: {}", answer.body.value("detail", "no reason"))};
}

json ask_experiments(const StationClient& station, const std::string& method, const std::string& target,
                     const json& body = nullptr) {
  return accepted(station.ask(method, target, body));
}

std::string text_of(const json& value) { return value.is_null() ? "" : value.get<std::string>(); }

std::string progress_line(const json& experiment) {
  const json& progress = experiment.at("progress");
  const auto state = experiment.at("state").get<std::string>();
  if (state == "waiting" && !experiment.at("waits_for").is_null()) {
    return "waits: " + text_of(experiment.at("waits_for_detail"));
  }
  const std::string why = text_of(experiment.at("detail"));
  if (state == "paused" || (state == "running" && !why.empty())) return fmt::format("{}: {}", state, why);
  if (!experiment.at("activity").is_null()) return fmt::format("{}: {}", state, text_of(experiment.at("activity")));
  if (progress.is_null()) return state;
  return fmt::format("{}: run {} of {}, step {} of {}, {:.0f} of {:.0f} s", state, progress.at("run").get<int>(),
                     progress.at("runs").get<int>(), progress.at("step").get<int>(), progress.at("steps").get<int>(),
                     progress.at("elapsed_s").get<double>(), progress.at("duration_s").get<double>());
}

bool is_over(const json& experiment) { return !experiment.at("ended_at_us").is_null(); }

// Shows each change of the line once, or all the time on a terminal.
class ProgressShown {
 public:
  void show(const json& experiment, const char* hint) {
    const std::string line = progress_line(experiment) + hint;
    if (line == last_) return;
    if (is_terminal_) {
      fmt::print(stderr, "\r\x1b[K{}", line);
    } else if (kind_of(line) != kind_of(last_)) {
      fmt::print(stderr, "{}\n", line);
    }
    std::fflush(stderr);
    last_ = line;
  }
  void end() const {
    if (is_terminal_) fmt::print(stderr, "\r\x1b[K");
  }

 private:
  static std::string kind_of(const std::string& line) { return line.substr(0, line.rfind(',')); }

  const bool is_terminal_ = ::isatty(STDERR_FILENO) != 0;
  std::string last_;
};

// The first interrupt of the person ends the experiment, the second one the wait.
class Interrupt {
 public:
  Interrupt() : signals_{loop_, SIGINT, SIGTERM} { arm(); }
  // Within so long.
  bool comes_within_ms(int ms) {
    loop_.restart();
    loop_.run_for(std::chrono::milliseconds{ms});
    return std::exchange(has_come_, false);
  }

 private:
  void arm() {
    signals_.async_wait([this](const boost::system::error_code& error, int) {
      if (error) return;
      has_come_ = true;
      arm();
    });
  }

  boost::asio::io_context loop_{1};
  boost::asio::signal_set signals_;
  bool has_come_ = false;
};

// In the count-down after an interruption.
bool goes_on_by_itself(const json& experiment) {
  const json& progress = experiment.at("progress");
  return progress.is_object() && progress.value("goes_on_in_s", json()).is_number();
}

// The signs of life of this invocation do not count: somebody else's do.
void say_whose(const StationAnswer& refused) {
  if (refused.body.value("reason", "") != "acts_for_another") return;
  fmt::print(stderr, "rheonaut: this command only looks on: {}\n", one_line(refused.body.value("detail", "")));
}

// An act that is sent again while the station is busy: SAFETY: a place that was taken loses no pause and no abort.
class DueAct {
 public:
  void is_asked_for(json body) {
    body_ = std::move(body);
    is_due_ = true;
  }
  void send(const StationClient& station, const std::string& target) {
    if (is_due_) is_due_ = gave_way(station.ask("POST", target, body_));
  }

 private:
  json body_;
  bool is_due_ = false;
};

json watch(const StationClient& station, std::int64_t id) {
  ProgressShown progress;
  Interrupt interrupt;
  const Keys keys{::isatty(STDERR_FILENO) != 0};  // where the count-down is shown
  const std::string one = fmt::format("{}/{}", kExperiments, id);
  bool is_interrupted = false, is_said = false, is_shown = false, is_ours = true;
  DueAct pause, abort;
  json seen = json::object();  // SAFETY: a sign of life is as old as what this tool has seen of the station
  BusyWait busy{{.pause = std::chrono::milliseconds{kWatch_ms}},
                fmt::format("rheonaut experiment show {} says what has become of it", id)};
  for (;;) {
    // A sign of life, answered without the runs. Refused when it has ended, or when somebody has taken it over: then it
    // is theirs.
    const StationAnswer kept = is_interrupted ? StationAnswer{} : station.ask("POST", one + "/keep-alive", seen);
    if (!gave_way(kept)) is_ours = kept.status == kDone;
    if (kept.status == kConflict && !std::exchange(is_said, true)) say_whose(kept);
    if (kept.status == kDone) seen["stamp_us"] = kept.body.at("stamp_us");
    const StationAnswer looked = kept.status == kDone || gave_way(kept) ? kept : station.ask("GET", one);
    if (!busy.is_busy(looked)) {
      json experiment = accepted(looked);
      const bool is_pressed = keys.pressed().has_value();  // before it is said that it matters
      const bool may_be_paused = is_ours && goes_on_by_itself(experiment);
      progress.show(experiment, may_be_paused && keys.are_read() ? " (any key pauses it)" : "");
      if (is_over(experiment)) {
        progress.end();
        if (!is_ours) return experiment;
        StationAnswer with_runs = station.ask("GET", one);
        while (busy.asks_again(with_runs)) with_runs = station.ask("GET", one);
        return accepted(with_runs);
      }
      // SAFETY: who presses a key while the robot is about to move again decides that it does not.
      const bool was_shown = std::exchange(is_shown, may_be_paused);
      if (is_pressed && was_shown) pause.is_asked_for(json::object());
    }
    pause.send(station, one + "/pause");
    if (interrupt.comes_within_ms(kWatch_ms)) {
      if (is_interrupted || !is_ours) throw std::runtime_error{"interrupted; the experiment is still there"};
      is_interrupted = true;
      abort.is_asked_for({{"reason", "interrupted"}});
    }
    abort.send(station, one + "/abort");
  }
}

void write_runs(std::ostream& out, const json& experiment) {
  Table table{{"run", "<state", "run id", "<fluid", "steps", "<reason"}};
  for (const json& run : experiment.at("runs")) {
    const json& fluid = run.at("variant").value("fluid", json());
    table.row({std::to_string(run.at("number").get<int>()), run.at("state"),
               run.at("run_id").is_null() ? "-" : std::to_string(run.at("run_id").get<std::int64_t>()),
               fluid.is_null() ? "any" : fluid.get<std::string>(), std::to_string(run.at("steps").size()),
               text_of(run.at("reason"))});
  }
  table.write(out);
}

// Writes what each run of an experiment with `until` performed, and what was known after it.
void write_knowledge(std::ostream& out, const json& experiment) {
  const auto with = [](const json& run) { return !run.at("knowledge").is_null(); };
  const json& runs = experiment.at("runs");
  const auto first = std::ranges::find_if(runs, with);
  if (first == runs.end()) return;
  const auto parameter = first->at("knowledge").at("parameter").get<std::string>();
  const auto is_at_bound = [&with](const json& run) {
    return with(run) && run.at("knowledge").value("at_bound", false);
  };
  const bool has_bound = std::ranges::any_of(runs, is_at_bound);
  std::vector<std::string> head{"run",     "step", "duty ×", parameter, fmt::format("sigma({})", parameter),
                                "fit (%)", "job"};
  if (has_bound) head.emplace_back("<that sigma");
  Table table{std::move(head)};
  for (const json& run : runs) {
    if (!with(run)) continue;
    const json &knowledge = run.at("knowledge"), &fit = knowledge.at("fit"), &variant = run.at("variant");
    const json &sigma = knowledge.at("sigma"), &value = fit.at("parameters").at(parameter);
    std::vector<std::string> row{
        std::to_string(run.at("number").get<int>()),         std::to_string(variant.at("step").get<int>()),
        cell(variant.at("duty_factor").get<double>()),       value.is_null() ? "-" : cell(value.get<double>()),
        sigma.is_null() ? "-" : cell(sigma.get<double>()),   fixed(fit.at("fit_percent").get<double>(), 1),
        std::to_string(fit.at("job_id").get<std::int64_t>())};
    if (has_bound) row.emplace_back(is_at_bound(run) ? kSigmaAtBound : "");
    table.row(std::move(row));
  }
  fmt::print(out, "\n");
  table.write(out);
}

int write_one(const ExperimentCommand& options, const json& experiment, std::ostream& out) {
  const bool is_done = !is_over(experiment) || experiment.at("state") == "done";
  const std::string outcome = outcome_of(experiment);
  if (options.json) {
    fmt::print(out, "{}\n", experiment.dump(2));
  } else {
    if (is_done) fmt::print(out, "{}\n", one_line(outcome));
    if (!experiment.at("runs").empty()) write_runs(out, experiment);
    write_knowledge(out, experiment);
  }
  return is_done ? 0 : not_done(kExperimentNotDone, outcome);
}

int begin_experiment(const ExperimentCommand& options, std::ostream& out) {
  const StationClient station{options.data_dir};
  json body{{"robot_id", options.robot},
            {"profile", profile_document(options.profile)},
            {"priority", options.priority},
            {"unattended", options.is_unattended}};
  if (!options.notes.empty()) body["notes"] = options.notes;
  const json experiment = ask_experiments(station, "POST", kExperiments, body);
  const auto id = experiment.at("experiment_id").get<std::int64_t>();
  return write_one(options, options.waits ? watch(station, id) : experiment, out);
}

int list_experiments(const ExperimentCommand& options, std::ostream& out) {
  const json experiments = ask_experiments(StationClient{options.data_dir}, "GET", kExperiments).at("experiments");
  if (options.json) {
    fmt::print(out, "{}\n", experiments.dump(2));
    return 0;
  }
  Table table{{"id", "<state", "<robot", "<name", "runs", "<begun", "<by", "<why"}};
  for (const json& one : experiments) {
    int begun = 0;
    for (const json& count : one.at("run_counts")) begun += count.get<int>();
    const std::string why = text_of(one.at(one.at("state") == "waiting" ? "waits_for" : "reason"));
    table.row({std::to_string(one.at("experiment_id").get<std::int64_t>()), one.at("state"), one.at("robot_id"),
               one_line(one.at("name").get<std::string>()),
               fmt::format("{} of {}", begun, one.at("runs_planned").get<int>()), time_text(one.at("created_at_us")),
               one.at("owner"), why});
  }
  table.write(out);
  return 0;
}

int act_on(const ExperimentCommand& options, const char* what, const json& body, std::ostream& out) {
  const StationClient station{options.data_dir};
  const std::string target = fmt::format("{}/{}/{}", kExperiments, options.experiment, what);
  const json experiment = ask_experiments(station, "POST", target, body);
  const json shown = options.waits ? watch(station, options.experiment) : experiment;
  const int status = write_one(options, shown, out);
  return options.waits ? status : 0;
}

int show(const ExperimentCommand& options, std::ostream& out) {
  const StationClient station{options.data_dir};
  if (options.waits) return write_one(options, watch(station, options.experiment), out);
  write_one(options, ask_experiments(station, "GET", fmt::format("{}/{}", kExperiments, options.experiment)), out);
  return 0;
}

constexpr const char* kWaits =
    "Wait for its end, and be the sign of life that it needs, unless another page or program has it; Ctrl-C aborts it";

}  // namespace

std::string outcome_of(const json& experiment) {
  const auto state = experiment.at("state").get<std::string>();
  const std::string why = text_of(experiment.at(state == "waiting" ? "waits_for_detail" : "detail"));
  return fmt::format("experiment {} ({}) is {}{}", experiment.at("experiment_id").get<std::int64_t>(),
                     experiment.at("name").get<std::string>(), state, why.empty() ? "" : ": " + why);
}

void add_options(CLI::App& command, ExperimentCommand& options) {
  using Act = ExperimentCommand::Act;
  command.require_subcommand(1);
  CLI::App* begin = offer(command, options, Act::begin, "begin", "Put an experiment into the queue of a robot");
  begin->add_option("profile", options.profile, "Name of a profile that comes with the program, or a file")
      ->required()
      ->check(named());
  begin->add_option("--robot", options.robot, "Id of the robot")->required()->check(named());
  begin->add_option("--notes", options.notes, "Of every run")->check(named());
  begin->add_option("--priority", options.priority, "-100 to 100; the highest begins first")->check(whole(-100, 100));
  begin->add_flag("--unattended", options.is_unattended, "It may go on while nobody is there, if its profile says so");
  begin->add_flag("--wait", options.waits, kWaits);
  begin->footer(
      "Exit status 5: it was aborted, cancelled or interrupted.\n"
      "Example: rheonaut experiment begin figure_7 --robot sim-1 --wait --data lab");
  offer(command, options, Act::list, "list", "List the experiments, newest first");
  offer_one(command, options, Act::show, "show", "Show one experiment and its runs")
      ->add_flag("--wait", options.waits, kWaits);
  offer_one(command, options, Act::pause, "pause", "Bring the robot to rest; its step is repeated later");
  offer_one(command, options, Act::resume, "resume", "Go on with one that is paused or held")
      ->add_flag("--wait", options.waits, kWaits);
  offer_one(command, options, Act::abort, "abort", "End it, with the robot at rest")
      ->add_option("--reason", options.reason, "Why")
      ->check(named());
  offer_one(command, options, Act::take_over, "take-over", "Go on with somebody else's experiment in your own name")
      ->add_flag("--wait", options.waits, kWaits);
  CLI::App* move = offer_one(command, options, Act::move, "move", "Give it another place in the queue of its robot");
  move->add_option("--before", options.before, "The experiment that is to come after it")
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
  move->add_option("--priority", options.priority, "Its new priority, without --before")->check(whole(-100, 100));
  command.footer("Example: rheonaut experiment list --data lab");
}

int run(const ExperimentCommand& options, std::ostream& out) {
  using Act = ExperimentCommand::Act;
  switch (options.act) {
    case Act::begin: return begin_experiment(options, out);
    case Act::list: return list_experiments(options, out);
    case Act::show: return show(options, out);
    case Act::pause: return act_on(options, "pause", nullptr, out);
    case Act::resume: return act_on(options, "resume", nullptr, out);
    case Act::abort:
      return act_on(options, "abort", options.reason.empty() ? json(nullptr) : json{{"reason", options.reason}}, out);
    case Act::take_over: return act_on(options, "take-over", nullptr, out);
    case Act::move: {
      json body{{"priority", options.priority}};
      if (options.before != 0) body["before"] = options.before;
      return act_on(options, "move", body, out);
    }
  }
  return 0;
}

}  // namespace server::cli
