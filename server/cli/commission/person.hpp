// The person who commissions a robot: questions on the terminal, or answers that were given beforehand in a file.
//
// Errors: throws UsageError for answers that are not known or not allowed, and where something must be asked and there
// is no terminal; Interrupted on Ctrl-C; Declined when the person does not want to go on.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace server::cli {

struct Interrupted {};
struct Declined {};

// Notices Ctrl-C (and SIGTERM, SIGHUP) in its waits, which then throw Interrupted; later signals change nothing.
class Interruption {
 public:
  // SIGPIPE is ignored from now on: a reader that is gone must not end the program before the robot is stopped.
  Interruption();
  void throw_if_come() { wait(std::chrono::milliseconds{0}); }
  void wait(std::chrono::milliseconds time);

 private:
  boost::asio::io_context loop_{1};
  boost::asio::signal_set signals_;
  bool has_come_ = false;
};

inline const std::vector<std::string> kDirections{"forwards", "backwards", "nothing"};

class Person {
 public:
  // `answers` is an object by the names of the questions; `says_yes` confirms everything. Lines go to standard error.
  // Throws UsageError for an answer that is none.
  Person(nlohmann::json answers, bool says_yes, Interruption& interruption);

  // Throws UsageError that names the questions for which there is no answer and no terminal.
  void must_answer(const std::vector<std::string>& questions) const;

  void tell(const std::string& line) const;  // never throws: a closed terminal changes nothing
  // SAFETY: what was typed before the question does not answer it. Throws Declined.
  void confirm(const std::string& what);
  double length_m(const std::string& name, const std::string& question);
  std::optional<double> maybe_length_m(const std::string& name, const std::string& question);
  std::string word(const std::string& name, const std::string& question, const std::vector<std::string>& allowed);
  std::string text(const std::string& name, const std::string& question);  // "": no answer

  // Called every 0.1 s while an answer is awaited on the terminal.
  void while_asked(std::function<void()> work) { while_asked_ = std::move(work); }

  const nlohmann::ordered_json& given() const { return given_; }  // what was answered, by name
  bool says_yes() const { return says_yes_; }
  std::vector<std::string> prepared() const;  // names of the answers that were given beforehand

 private:
  std::string asked(const std::string& question);
  void forget_typed() const;  // what was typed before a question does not answer it

  nlohmann::json answers_;
  bool says_yes_;
  bool has_terminal_;
  Interruption& interruption_;
  std::function<void()> while_asked_;
  nlohmann::ordered_json given_ = nlohmann::ordered_json::object();
};

}  // namespace server::cli
