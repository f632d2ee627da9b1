// Asks the station anew for each picture.
#include "server/cli/robots/watch.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <boost/asio/signal_set.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <sstream>

#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/keys.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/private_file.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

constexpr std::int64_t kStaleUs = 1'000'000;  // the robot's own default of link_timeout_ms
constexpr microseconds kWatchPatience{1'000'000};
constexpr double kUsOfOneS = 1e6, kMmOfOneM = 1e3, kPercent = 100;
constexpr std::size_t kWidestRobot = 14, kPlainColumns = 200;

std::int64_t age_us(const json& robot, std::int64_t now_us) {
  const json& at = robot.at("last_received_at_us");
  return at.is_null() ? -1 : std::max<std::int64_t>(0, now_us - at.get<std::int64_t>());
}

bool is_stale(const json& robot, std::int64_t now_us) {
  const std::int64_t age = age_us(robot, now_us);
  return robot.at("link") != "connected" || age < 0 || age > kStaleUs;
}

std::string bracketed(const std::string& text, bool is_old) { return is_old ? "(" + text + ")" : text; }

std::string position_text(const json& robot) {
  if (robot.at("sample").is_null()) return "-";
  const json& sd = robot.at("position_sd_m");
  return fmt::format("{} ± {}", fixed(kMmOfOneM * robot.at("sample").at("position_m").get<double>(), 1),
                     sd.is_null() ? "?" : fixed(kMmOfOneM * sd.get<double>(), 1));
}

std::string duty_text(const json& robot) {
  if (robot.at("sample").is_null()) return "-";
  return fmt::format("{} %", fixed(kPercent * robot.at("sample").at("duty").get<double>(), 0));
}

std::string link_text(const json& robot, std::int64_t now_us) {
  const std::int64_t age = age_us(robot, now_us);
  const std::string seconds = age < 0 ? "never" : fixed(static_cast<double>(age) / kUsOfOneS, 1) + " s";
  return robot.at("link") == "connected" ? seconds : "LOST " + seconds;
}

// A stop of any cause is in force, or is on its way.
std::string stop_text(const json& robot) {
  if (!robot.at("emergency_id").is_null()) return "STOPPED: " + robot.at("emergency_cause").get<std::string>();
  return robot.at("pending_stop").is_null() ? "" : "stop not confirmed";
}

std::string mode_text(const json& robot) { return robot.at("mode").is_null() ? "-" : robot.at("mode"); }

std::string control_text(const json& robot) {
  const json& control = robot.at("control");
  return control.is_object() ? one_line(control.value("holder", std::string{"-"})) : "-";
}

// The first characters of the text, one a column.
std::string cut(const std::string& text, std::size_t columns) {
  std::size_t seen = 0, i = 0;
  for (; i < text.size(); ++i) {
    if ((static_cast<unsigned char>(text[i]) & 0xC0U) != 0x80U && seen++ == columns) break;
  }
  return text.substr(0, i);
}

// Those of the names that the station knows no robot of; empty: it knows all.
std::string unknown_of(const json& robots, const std::vector<std::string>& names) {
  std::vector<std::string> unknown;
  for (const std::string& name : names) {
    const auto is_it = [&name](const json& robot) { return robot.at("robot_id") == name; };
    if (std::ranges::none_of(robots, is_it)) unknown.push_back("'" + one_line(name) + "'");
  }
  return unknown.empty() ? "" : fmt::format("the station knows no robot {}", fmt::join(unknown, ", "));
}

json chosen_of(const json& robots, const std::vector<std::string>& names) {
  json chosen = json::array();
  for (const json& robot : robots) {
    if (names.empty() || std::ranges::find(names, robot.at("robot_id").get<std::string>()) != names.end()) {
      chosen.push_back(robot);
    }
  }
  return chosen;
}

std::string json_lines(const json& robots, std::int64_t now_us) {
  std::string text;
  for (const json& robot : robots) {
    nlohmann::ordered_json line{{"utc_us", now_us}};
    const std::int64_t age = age_us(robot, now_us);
    for (const char* name : {"robot_id", "link", "mode", "position_sd_m", "setpoint_m", "control", "emergency_id",
                             "emergency_cause", "pending_stop", "sample"}) {
      line[name] = robot.at(name);
    }
    line["age_us"] = age < 0 ? json() : json(age);
    line["is_stale"] = is_stale(robot, now_us);
    text += line.dump() + "\n";
  }
  return text;
}

// Another screen without a cursor and without echo; the person's own one comes back.
class FullScreen {
 public:
  explicit FullScreen(bool is_on) : is_on_{is_on}, keys_{is_on} {
    if (!is_on_) return;
    write("\x1b[?1049h\x1b[?25l");
  }
  ~FullScreen() {
    if (!is_on_) return;
    write("\x1b[?25h\x1b[?1049l");
  }
  FullScreen(const FullScreen&) = delete;
  FullScreen& operator=(const FullScreen&) = delete;

  bool is_q_pressed() const { return keys_.pressed() == 'q'; }

 private:
  static void write(const char* text) {
    std::fputs(text, stdout);
    std::fflush(stdout);
  }

  bool is_on_;
  Keys keys_;
};

struct Size {
  std::size_t columns = 80, rows = 24;
};

Size terminal_size() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) return {};
  return {size.ws_col, size.ws_row};
}

bool has_colours() {
  const char* none = std::getenv("NO_COLOR");  // https://no-color.org
  return ::isatty(STDOUT_FILENO) != 0 && (none == nullptr || *none == '\0');
}

class Watch {
 public:
  explicit Watch(const WatchCommand& options) : options_{options} {}

  // What the station says now; false when it does not answer.
  bool look() {
    try {
      const StationClient station{options_.data_dir};  // anew: it may have been started on another port
      StationAnswer answer = station.ask_at_once({{"GET", "/api/v1/robots"}}, kWatchPatience).front();
      if (answer.status == 0) throw std::runtime_error{answer.text};
      const json robots = asked(std::move(answer)).at("robots");
      robots_ = chosen_of(robots, options_.robots);
      unknown_ = unknown_of(robots, options_.robots);
      problem_.clear();
    } catch (const std::exception& error) {
      problem_ = runtime::text_of(error);
    }
    return problem_.empty();
  }
  const std::string& problem() const { return problem_; }
  const std::string& unknown() const { return unknown_; }  // what of the names it knows no robot of

  std::string plain() const {
    if (options_.form.is_json) return problem_.empty() ? json_lines(robots_, clock_.utc_us()) : "";
    std::string text;
    for (const std::string& line : watch_lines(robots_, clock_.utc_us(), kPlainColumns, false)) text += line + "\n";
    return text;
  }

  // SAFETY: when the station is silent the old values grow old in the picture, and the last line says why.
  std::string picture() const {
    const Size size = terminal_size();
    std::vector<std::string> lines = watch_lines(robots_, clock_.utc_us(), size.columns, has_colours());
    if (lines.size() + 1 > size.rows) lines.resize(std::max<std::size_t>(size.rows, 2) - 1);
    const std::string now = unknown_.empty() ? "q or Ctrl-C: end" : unknown_ + "; q or Ctrl-C: end";
    lines.push_back(cut(problem_.empty() ? now : "NO ANSWER: " + one_line(problem_), size.columns));
    std::string text = "\x1b[H";
    for (std::size_t i = 0; i < lines.size(); ++i) text += (i == 0 ? "" : "\r\n") + lines[i] + "\x1b[K";
    return text + "\x1b[J";
  }

 private:
  const WatchCommand& options_;
  boost::asio::io_context loop_;
  runtime::SystemClock clock_{loop_};
  json robots_ = json::array();
  std::string problem_;
  std::string unknown_;
};

int watch_on(const WatchCommand& options) {
  Watch watch{options};
  const bool is_screen = ::isatty(STDOUT_FILENO) != 0 && !options.form.is_json;
  boost::asio::io_context loop{1};
  boost::asio::signal_set signals{loop, SIGINT, SIGTERM, SIGHUP};
  bool is_over = false;
  signals.async_wait([&is_over](const boost::system::error_code&, int) { is_over = true; });
  const FullScreen screen{is_screen};
  while (!is_over) {
    if (!watch.look() && !is_screen) fmt::print(stderr, "rheonaut: {}\n", one_line(watch.problem()));
    const std::string text = is_screen ? watch.picture() : watch.plain();
    if (std::fputs(text.c_str(), stdout) < 0 || std::fflush(stdout) != 0) return 0;
    loop.run_for(std::chrono::microseconds{static_cast<std::int64_t>(options.every_s * kUsOfOneS)});
    is_over = is_over || (is_screen && screen.is_q_pressed());
  }
  return 0;
}

}  // namespace

std::vector<std::string> watch_lines(const json& robots, std::int64_t now_us, std::size_t columns, bool with_colours) {
  Table table{{"robot", "<mode", "position mm", "duty", "age", "<stop", "<in control"}};
  for (const json& robot : robots) {
    const bool is_old = is_stale(robot, now_us);
    table.row({cut(robot.at("robot_id"), kWidestRobot), bracketed(mode_text(robot), is_old),
               bracketed(position_text(robot), is_old), bracketed(duty_text(robot), is_old), link_text(robot, now_us),
               stop_text(robot), control_text(robot)});
  }
  std::ostringstream text;
  table.write(text);
  std::vector<std::string> lines;
  std::istringstream in{text.str()};
  for (std::string line; std::getline(in, line);) lines.push_back(cut(line, columns));
  for (std::size_t i = 0; with_colours && i < robots.size(); ++i) {
    const char* colour = is_stale(robots[i], now_us)    ? "\x1b[2m"
                         : stop_text(robots[i]).empty() ? nullptr
                                                        : "\x1b[1;31m";
    if (colour != nullptr) lines[i + 1] = colour + lines[i + 1] + "\x1b[0m";
  }
  return lines;
}

void add_options(CLI::App& command, WatchCommand& options) {
  command.add_option("robot_id", options.robots, "The robots; without any, all robots of the station")->check(named());
  command.add_flag("--once", options.is_once, "Print one table and end");
  command.add_option("--every-s", options.every_s, "Time between two pictures (default: 0.2)")
      ->check(from_to(0.05, 3600));
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  add_json_flag(command, options.form);
  command.footer(
      "The position is the robot's own estimate, with its standard deviation. Values that are older than 1 s stand in "
      "brackets. NO_COLOR switches colours off. On a terminal q or Ctrl-C ends it.\n"
      "Example: rheonaut watch --data lab\n"
      "Example: rheonaut watch --once --json --data lab");
}

int run(const WatchCommand& options, std::ostream& out) {
  if (!runtime::is_there(options.data_dir)) {  // a station that is not there yet is waited for; a wrong name is not
    throw std::runtime_error{
        fmt::format("there is no folder '{}'; --data names that of a station", options.data_dir.string())};
  }
  if (!options.is_once) return watch_on(options);
  Watch watch{options};
  if (!watch.look()) throw std::runtime_error{watch.problem()};
  if (!watch.unknown().empty()) throw std::runtime_error{watch.unknown()};
  out << watch.plain();
  return 0;
}

}  // namespace server::cli
