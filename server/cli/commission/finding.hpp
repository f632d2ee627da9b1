// What a step of the commissioning of a robot found: a verdict, the figures, and the bound by which they were judged.
//
//   pass       as it should be
//   attention  the robot can be used; `action` says what to see to first
//   fail       something is wrong with the robot, or the step did not end well
//   not_done   the step was left out, or was not reached; `found` says why
// Errors: none.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace server::cli {

enum class Verdict : std::uint8_t { pass, attention, fail, not_done };

inline const char* text(Verdict verdict) {
  switch (verdict) {
    case Verdict::pass: return "pass";
    case Verdict::attention: return "attention";
    case Verdict::fail: return "fail";
    case Verdict::not_done: return "not_done";
  }
  return "fail";
}

struct StepFinding {
  std::string step{};  // "imu_axis": for programs
  Verdict verdict = Verdict::not_done;
  std::string found{};   // in words, with the figures
  std::string bound{};   // by what it was judged; empty: there is no bound
  std::string action{};  // what to do; empty: nothing
  nlohmann::ordered_json figures = nlohmann::ordered_json::object();
};

inline StepFinding not_done(std::string step, std::string why) {
  return {.step = std::move(step), .verdict = Verdict::not_done, .found = std::move(why)};
}

}  // namespace server::cli
