// Lines from the terminal, read so that Ctrl-C is noticed while nobody types.
#include "server/cli/commission/person.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <stdexcept>

#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/output.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

constexpr int kLookAtSignalsMs = 100;
constexpr double kLongestM = 100;
constexpr std::size_t kLongestLine = 1000;

// What the file of answers may hold.
const std::vector<std::string> kQuestions{"free_ahead_m", "free_behind_m", "direction",
                                          "moved_m",      "set_dead_zone", "signed_by"};

std::optional<double> number_of(const std::string& line) {
  double value = 0;
  const char* const end = line.data() + line.size();
  const auto read = std::from_chars(line.data() + (line.starts_with('+') ? 1 : 0), end, value);
  if (read.ec != std::errc{} || read.ptr != end || !(std::abs(value) <= kLongestM)) return std::nullopt;
  return value;
}

void say(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
}

void check_answer(const std::string& name, const json& answer) {
  const auto refuse = [&name, &answer](const std::string& what) {
    throw UsageError{fmt::format("answers: {} must be {}, is {}", name, what, answer.dump())};
  };
  if (std::ranges::find(kQuestions, name) == kQuestions.end()) {
    throw UsageError{fmt::format("answers: '{}' is no question; there are {}", name, fmt::join(kQuestions, ", "))};
  }
  const bool is_length = answer.is_number() && std::abs(answer.get<double>()) <= kLongestM;
  if (name == "direction") {
    const std::string word = answer.is_string() ? answer.get<std::string>() : "";
    if (std::ranges::find(kDirections, word) == kDirections.end()) {
      refuse(fmt::format("one of {}", fmt::join(kDirections, ", ")));
    }
  } else if (name == "signed_by" || name == "set_dead_zone") {
    if (!answer.is_string()) refuse("a text");
  } else if (name == "moved_m") {
    if (!is_length && !answer.is_null()) refuse(fmt::format("a number of metres up to {}, or null", kLongestM));
  } else if (!is_length || answer.get<double>() < 0) {
    refuse(fmt::format("a number of metres from 0 to {}", kLongestM));
  }
}

}  // namespace

Interruption::Interruption() : signals_{loop_, SIGINT, SIGTERM, SIGHUP} {
  std::signal(SIGPIPE, SIG_IGN);
  signals_.async_wait([this](const boost::system::error_code& error, int) { has_come_ = !error; });
}

void Interruption::wait(std::chrono::milliseconds time) {
  loop_.restart();
  loop_.poll();  // run_for() of no time runs nothing
  if (!has_come_ && time.count() > 0) {
    loop_.restart();
    loop_.run_for(time);
  }
  if (has_come_) throw Interrupted{};
}

Person::Person(json answers, bool says_yes, Interruption& interruption)
    : answers_{std::move(answers)},
      says_yes_{says_yes},
      has_terminal_{::isatty(STDIN_FILENO) != 0},
      interruption_{interruption} {
  for (const auto& [name, answer] : answers_.items()) check_answer(name, answer);
}

void Person::must_answer(const std::vector<std::string>& questions) const {
  if (has_terminal_) return;
  std::vector<std::string> missing;
  for (const std::string& name : questions) {
    if (!answers_.contains(name)) missing.push_back(name);
  }
  if (!says_yes_) missing.emplace_back("the confirmations (--yes)");
  if (missing.empty()) return;
  throw UsageError{fmt::format("there is no terminal to ask, and no answer to {}; give a file with --answers",
                               fmt::join(missing, ", "))};
}

void Person::tell(const std::string& line) const { say(line + "\n"); }

std::vector<std::string> Person::prepared() const {
  std::vector<std::string> names;
  for (const auto& [name, answer] : answers_.items()) names.push_back(name);
  return names;
}

std::string Person::asked(const std::string& question) {
  say(question + " ");
  std::string line;
  for (;;) {
    interruption_.throw_if_come();
    if (while_asked_) while_asked_();
    pollfd input{STDIN_FILENO, POLLIN, 0};
    if (::poll(&input, 1, kLookAtSignalsMs) <= 0) continue;
    char one = 0;
    const ssize_t got = ::read(STDIN_FILENO, &one, 1);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) throw Declined{};  // the terminal is closed
    if (one == '\n') return line;
    if (one != '\r' && line.size() < kLongestLine) line += one;
  }
}

void Person::forget_typed() const {
  if (has_terminal_) ::tcflush(STDIN_FILENO, TCIFLUSH);
}

void Person::confirm(const std::string& what) {
  interruption_.throw_if_come();
  if (says_yes_) return tell(what + " [yes, by --yes]");
  for (;;) {
    forget_typed();
    const std::string answer = asked(what + " [yes/no]");
    if (answer == "yes" || answer == "y") return;
    if (answer == "no" || answer == "n") throw Declined{};
  }
}

std::optional<double> Person::maybe_length_m(const std::string& name, const std::string& question) {
  if (answers_.contains(name)) {
    const json answer = given_[name] = answers_.at(name);
    return answer.is_number() ? std::optional{answer.get<double>()} : std::nullopt;
  }
  if (!has_terminal_) return std::nullopt;
  for (;;) {
    const std::string line = asked(question);
    if (line.empty()) return std::nullopt;
    const auto value = number_of(line);
    if (value) given_[name] = *value;
    if (value) return value;
    tell(fmt::format("A number of metres up to {}, such as 0.35", kLongestM));
  }
}

double Person::length_m(const std::string& name, const std::string& question) {
  for (;;) {
    const std::optional<double> length_m = maybe_length_m(name, question);
    if (length_m && *length_m >= 0) return *length_m;
    if (!has_terminal_) throw Declined{};
    tell("A length of 0 or more is needed");
  }
}

std::string Person::word(const std::string& name, const std::string& question,
                         const std::vector<std::string>& allowed) {
  for (;;) {
    forget_typed();
    const std::string word = answers_.contains(name) ? answers_.at(name).get<std::string>()
                                                     : asked(fmt::format("{} [{}]", question, fmt::join(allowed, "/")));
    if (std::ranges::find(allowed, word) == allowed.end()) continue;
    given_[name] = word;
    return word;
  }
}

std::string Person::text(const std::string& name, const std::string& question) {
  if (answers_.contains(name)) return one_line(answers_.at(name).get<std::string>());
  if (!has_terminal_) return {};
  forget_typed();
  return one_line(asked(question));
}

}  // namespace server::cli
