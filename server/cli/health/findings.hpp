// What `rheonaut doctor` found: a list of findings, each with what is and what to do, in words for people.
//
//   fine     as it should be
//   note     not wrong, but worth knowing, or it could not be looked at
//   problem  something is wrong; the doctor's exit code is then 1
// Errors: none.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace server::cli {

enum class Grade : std::uint8_t { fine, note, problem };

inline const char* text(Grade grade) {
  switch (grade) {
    case Grade::fine: return "ok";
    case Grade::note: return "note";
    case Grade::problem: return "problem";
  }
  return "problem";
}

struct Finding {
  Grade grade = Grade::fine;
  std::string topic;   // "disk": one word for people and programs
  std::string what;    // what is, and what is wrong with it
  std::string action;  // what to do; empty: nothing
};

class Findings {
 public:
  void fine(std::string topic, std::string what) { add({Grade::fine, std::move(topic), std::move(what), ""}); }
  void note(std::string topic, std::string what, std::string action) {
    add({Grade::note, std::move(topic), std::move(what), std::move(action)});
  }
  void problem(std::string topic, std::string what, std::string action) {
    add({Grade::problem, std::move(topic), std::move(what), std::move(action)});
  }

  void append(const Findings& others) { all_.insert(all_.end(), others.all_.begin(), others.all_.end()); }

  const std::vector<Finding>& all() const { return all_; }
  std::size_t problems() const {
    return static_cast<std::size_t>(std::ranges::count(all_, Grade::problem, &Finding::grade));
  }

 private:
  void add(Finding finding) { all_.push_back(std::move(finding)); }
  std::vector<Finding> all_;
};

}  // namespace server::cli
