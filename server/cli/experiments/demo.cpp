// Two programs, one experiment, one link.
#include "server/cli/experiments/demo.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/design/estimator.hpp"
#include "server/cli/experiments/child_program.hpp"
#include "server/cli/experiments/experiment.hpp"
#include "server/cli/experiments/station_work.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"
#include "server/config/data_folder.hpp"

namespace server::cli {
namespace {

using nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

constexpr const char* kRobot = "sim-1";
constexpr const char* kFluid = "non_newtonian";  // equation (29)
constexpr std::chrono::milliseconds kLook{100};
constexpr int kMostLooks = 600;  // 60 s for either program to start

struct Interrupted {};

// Notices the person's Ctrl-C between two looks.
class Patience {
 public:
  Patience() : signals_{loop_, SIGINT, SIGTERM, SIGHUP} {
    signals_.async_wait([this](const boost::system::error_code& error, int) { has_come_ = !error; });
  }
  // Waits so long; throws Interrupted when the signal has come.
  void wait(std::chrono::milliseconds time) {
    loop_.restart();
    loop_.run_for(time);
    if (has_come_) throw Interrupted{};
  }
  bool is_interrupted() {
    loop_.restart();
    loop_.poll();
    return has_come_;
  }

 private:
  boost::asio::io_context loop_{1};
  boost::asio::signal_set signals_;
  bool has_come_ = false;
};

// What happens, at once: on standard output, or beside a JSON document on standard error.
class Narrator {
 public:
  explicit Narrator(std::FILE* stream) : stream_{stream}, is_terminal_{::isatty(::fileno(stream)) != 0} {}
  bool is_terminal() const { return is_terminal_; }
  void say(const std::string& line) const { print(line + "\n"); }
  void say_over_the_last(const std::string& line) const { print("\r\x1b[K" + line); }
  void end_line() const {
    if (is_terminal_) print("\n");
  }

 private:
  void print(const std::string& text) const {
    fmt::print(stream_, "{}", text);
    std::fflush(stream_);
  }

  std::FILE* stream_;
  bool is_terminal_;
};

// Of a log, where it says why.
std::string end_of_file(const std::filesystem::path& file) {
  constexpr std::size_t kMostBytes = 64 * 1024;
  std::ifstream in{file, std::ios::binary | std::ios::ate};
  const auto bytes = static_cast<std::size_t>(std::max<std::streamoff>(in.tellg(), 0));
  in.seekg(static_cast<std::streamoff>(bytes - std::min(bytes, kMostBytes)));
  std::string text(std::min(bytes, kMostBytes), '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  return text;
}

// Until `is_there`, as long as the program runs.
template <class IsThere>
void wait_for(const char* what, ChildProgram& program, const std::filesystem::path& log, Patience& patience,
              const IsThere& is_there) {
  for (int look = 0; look < kMostLooks; ++look) {
    if (is_there()) return;
    if (program.has_ended()) {
      throw std::runtime_error{fmt::format("{} did not start; it says:\n{}", what, end_of_file(log))};
    }
    patience.wait(kLook);
  }
  throw std::runtime_error{fmt::format("{} is not there after 60 s; its output is in '{}'", what, log.string())};
}

// The station gets the model of the fluid, and sends it to the robot.
void send_model(const StationWork& station, Patience& patience) {
  EstimatorQuestion question;
  question.form.is_json = true;
  std::ostringstream model;
  if (run(question, model) != 0) throw std::runtime_error{"the model of the fluid cannot be made"};
  station.post(fmt::format("/api/v1/fluids/{}/model", kFluid), json::parse(model.str()));
  station.post(fmt::format("/api/v1/robots/{}/fluid", kRobot), {{"fluid", kFluid}});
  for (int look = 0; look < kMostLooks; ++look) {
    const json state = station.get(fmt::format("/api/v1/robots/{}", kRobot)).at("model");
    if (state.at("state") == "confirmed") return;
    if (state.at("state") == "refused") break;
    patience.wait(kLook);
  }
  throw std::runtime_error{"the robot did not take the model of the fluid"};
}

// One line of where the robot is: on a terminal always the same line, otherwise once in two seconds.
class Progress {
 public:
  explicit Progress(const Narrator& narrator) : narrator_{narrator} {}
  void show(const json& experiment, const json& robot) {
    const json& progress = experiment.at("progress");
    const json& sample = robot.at("sample");
    if (progress.is_null() || sample.is_null() || robot.at("position_sd_m").is_null()) return;
    const double elapsed_s = progress.at("elapsed_s").get<double>();
    const double setpoint_m = robot.at("setpoint_m").is_null() ? 0 : robot.at("setpoint_m").get<double>();
    // What the controller sees is the estimate and the disturbance.
    const double seen_m = sample.at("position_m").get<double>();
    const double estimate_m = seen_m - robot.at("disturbance_m").get<double>();
    const std::string line = fmt::format(
        "  {:4.1f} s   setpoint {:5.1f} mm   seen by the controller {:5.1f} mm   estimated position {:5.1f} ± {:.1f} "
        "mm   "
        "duty {:+.2f}",
        elapsed_s, 1e3 * setpoint_m, 1e3 * seen_m, 1e3 * estimate_m, 2e3 * robot.at("position_sd_m").get<double>(),
        sample.at("duty").get<double>());
    if (narrator_.is_terminal()) {
      narrator_.say_over_the_last(line);
    } else if (elapsed_s >= next_s_) {
      narrator_.say(line);
      next_s_ = elapsed_s + 2;
    }
  }
  void end() const { narrator_.end_line(); }

 private:
  const Narrator& narrator_;
  double next_s_ = 0;
};

void say_measures(const Narrator& narrator, const json& steps, const json& run) {
  Table table{{"step", "to (m)", "settling (s)", "overshoot (%)", "error (mm)", "± 2 sd (mm)"}};
  for (const json& step : steps) {
    const auto number = [&step](const char* name, double scale, int decimals) {
      return step.at(name).is_null() ? std::string{"-"} : fixed(scale * step.at(name).get<double>(), decimals);
    };
    table.row({step.at("cause").get<std::string>(), number("target_m", 1, 2), number("settling_s", 1, 2),
               number("overshoot_percent", 1, 2), number("steady_state_error_m", 1e3, 2),
               number("position_sd_m", 2e3, 2)});
  }
  std::ostringstream text;
  table.write(text);
  narrator.say(text.str() + "(by the robot's estimate, which is how it steers)");
  narrator.say(fmt::format("samples: {} recorded, {} lost", run.at("samples_stored").get<std::int64_t>(),
                           run.at("samples_lost").get<std::int64_t>()));
}

struct Performed {
  json experiment;                                   // as the station has it, ended
  json steps = json::array(), run = json::object();  // of one that is done
  bool is_done() const { return experiment.at("state") == "done"; }
};

// Figure 7. Gives signs of life while it lasts: when they end, the robot stops.
Performed perform(const StationClient& client, const Narrator& narrator, Patience& patience) {
  Progress progress{narrator};
  const auto ask = [&client, &patience](const std::string& method, const std::string& target, const json& body) {
    patience.wait(std::chrono::milliseconds{0});  // throws when the person interrupts it
    return client.ask(method, target, body);
  };
  const std::string robot = fmt::format("/api/v1/robots/{}", kRobot);
  const StationWork station{ask, [&](const json& experiment) {
                              progress.show(experiment, client.ask("GET", robot).body);
                              patience.wait(std::chrono::milliseconds{1});
                            }};
  send_model(station, patience);
  const json begun = station.post("/api/v1/experiments", {{"robot_id", kRobot}, {"profile", "figure_7"}});
  Performed performed{station.finished_experiment(begun.at("experiment_id").get<std::int64_t>())};
  progress.end();
  const json& ended = performed.experiment;
  if (!performed.is_done()) return performed;
  const std::string run = fmt::format("/api/v1/runs/{}", ended.at("runs").front().at("run_id").get<std::int64_t>());
  performed.steps = station.get(run + "/step-metrics").at("steps");
  performed.run = station.get(run);
  say_measures(narrator, performed.steps, performed.run);
  return performed;
}

OrderedJson document(const Performed& performed, const std::filesystem::path& database) {
  OrderedJson out{{"experiment", performed.experiment}, {"steps", performed.steps}};
  out["samples_stored"] = performed.is_done() ? performed.run.at("samples_stored") : json{};
  out["samples_lost"] = performed.is_done() ? performed.run.at("samples_lost") : json{};
  out["database"] = database.string();
  return out;
}

// A link for one page.
std::string login_link(const StationClient& client) {
  return asked(client.ask("POST", "/api/v1/login-links")).at("url").get<std::string>();
}

std::filesystem::path own_folder() { return std::filesystem::read_symlink("/proc/self/exe").parent_path(); }

}  // namespace

void add_options(CLI::App& command, Demo& options) {
  command
      .add_option("--data", options.data_dir,
                  "Folder for the station's files (default: rheonaut-demo); kept, and used again")
      ->check(named());
  command.add_option("--seed", options.seed, "Of the simulated sensors' noise (default: 21)");
  auto* once = command.add_flag("--once", options.is_once, "End after the experiment");
  command
      .add_flag("--json", options.is_json,
                "With --once: print the experiment, its steps and the samples counted as JSON; all else goes to "
                "standard error")
      ->needs(once);
  command.footer("Example: rheonaut demo");
}

int run(const Demo& options, std::ostream& out) {
  config::make_data_folder(options.data_dir);
  const std::filesystem::path data = std::filesystem::absolute(options.data_dir);
  const std::filesystem::path endpoints = data / "endpoints.json", station_log = data / "station.log";
  const std::filesystem::path robot_log = data / "robot.log";
  if (!config::FolderLock::try_take(data)) {
    throw std::runtime_error{fmt::format("{} uses '{}'; stop it, or choose another folder with --data",
                                         config::FolderLock::holder(data), data.string())};
  }
  const std::filesystem::path database = data / "station.sqlite";
  const Narrator narrator{options.is_json ? stderr : stdout};
  int status = 0;
  Patience patience;
  try {
    narrator.say(
        "A station and a simulated robot start on this machine. The robot swims in the paper's fluid, equation (29), "
        "and\nsteers by its estimated position, as a real one does.");
    ChildProgram station{own_folder() / "rheonaut", {"serve", "--data", data.string()}, station_log};
    std::optional<StationClient> client;
    wait_for("the station", station, station_log, patience, [&] {
      // Not those of a station that was killed here.
      const json addresses = json::parse(end_of_file(endpoints), nullptr, false);
      if (addresses.is_object() && addresses.value("pid", 0) == station.pid()) client.emplace(data);
      return client.has_value();
    });
    const json addresses = json::parse(end_of_file(endpoints));
    const auto robots = addresses.at("robots").get<std::string>();
    narrator.say(fmt::format("\npage: {}\n      (a link for one browser, once)\n", login_link(*client)));
    ChildProgram robot{own_folder() / "rheonaut-sim",
                       {"--station", robots, "--id", kRobot, "--seed", std::to_string(options.seed)},
                       robot_log};
    wait_for("the simulated robot", robot, robot_log, patience, [&] {
      const StationAnswer answer = client->ask("GET", fmt::format("/api/v1/robots/{}", kRobot));
      return answer.status == 200 && answer.body.at("link") == "connected" && !answer.body.at("sample").is_null();
    });
    narrator.say(
        "Experiment of Figure 7: to 0.1 m, after 20 s the measured position is shifted by -0.05 m, 40 s in all.");
    const Performed performed = perform(*client, narrator, patience);
    if (!performed.is_done()) status = not_done(kExperimentNotDone, outcome_of(performed.experiment));
    narrator.say(fmt::format("\nEverything is recorded in {}", database.string()));
    if (options.is_json) write_json(out, document(performed, database));
    if (!options.is_once) {
      narrator.say(
          fmt::format("The station and the robot stay up: drive the robot on the page. Ctrl-C ends both.\npage: {}",
                      login_link(*client)));
      while (!station.has_ended()) patience.wait(kLook);
      throw std::runtime_error{fmt::format("the station has ended; its output is in '{}'", station_log.string())};
    }
  } catch (const Interrupted&) {
    narrator.say("\nended");
  } catch (const std::exception&) {
    if (!patience.is_interrupted()) throw;
    narrator.say("\nended");  // the signal broke a request off
  }
  return status;
}

}  // namespace server::cli
