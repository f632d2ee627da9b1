// One list of statements; the languages differ in how they index, comment and frame it.
#include "control/discretisation/controller_code.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <vector>

#include "base/invalid_argument.hpp"

namespace control {
namespace {

// The shortest decimals that are this double again.
std::string digits(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

std::size_t states(const ParallelSections& sections) {
  return sections.first_order.size() + 2 * sections.second_order.size();
}

// The i-th state, from 0.
std::string state(CodeLanguage language, std::size_t i) {
  return language == CodeLanguage::c ? base::join_text("state[", i, "]") : base::join_text("state(", i + 1, ")");
}

std::vector<std::string> statements(CodeLanguage language, const ParallelSections& sections) {
  const std::string real = language == CodeLanguage::c ? "double " : "";
  std::vector<std::string> lines{real + "duty = " + digits(sections.direct) + " * error_m;"};
  std::size_t i = 0;
  for (const FirstOrderSection& s : sections.first_order) {
    const std::string x = state(language, i++);
    lines.push_back(x + " = " + digits(s.pole) + " * " + x + " + " + digits(s.residue) + " * error_m;");  // (1)
    lines.push_back("duty = duty + " + x + ";");
  }
  for (std::size_t j = 0; j < sections.second_order.size(); ++j, i += 2) {
    const SecondOrderSection& s = sections.second_order[j];
    const std::string w = state(language, i), before = state(language, i + 1), y = base::join_text("pair_", j + 1);
    lines.push_back(real + y + " = " + digits(s.b0) + " * error_m + " + w + ";");  // (2)
    lines.push_back(w + " = " + digits(s.b1) + " * error_m - (" + digits(s.a1) + ") * " + y + " + " + before + ";");
    lines.push_back(before + " = -(" + digits(s.a2) + ") * " + y + ";");
    lines.push_back("duty = duty + " + y + ";");
  }
  return lines;
}

std::vector<std::string> head(const FopdController& controller, const Discretisation& made) {
  const DiscretisationErrors& errors = made.errors;
  return {"Fractional PD controller, made by rheonaut discretise.",
          "",
          "  C(s) = kp (1 + kd s^mu),  kp = " + digits(controller.kp) + " duty/m, kd = " + digits(controller.kd) +
              ", mu = " + digits(controller.mu),
          base::join_text("  every ", made.options.period_s, " s; up to ", 100 * errors.max_relative_in_bandwidth,
                          " % and ", errors.max_deg_in_bandwidth, " degrees off C(s) below ", errors.bandwidth_rad_s,
                          " rad/s"),
          "",
          "Call it once in each period with the error, setpoint less position, in m. The result is the duty",
          "that the controller asks for: limit it to what the motor takes (-1 to 1), and give the limited",
          "duty to the motor only. The state belongs to the errors: never compute it from the limited duty.",
          "All states are 0 before the first call, and again when the controller takes over from another."};
}

std::string c_text(const FopdController& controller, const Discretisation& made) {
  const std::size_t count = std::max<std::size_t>(1, states(made.sections));
  std::string text = "/*\n";
  for (const std::string& line : head(controller, made)) text += line.empty() ? " *\n" : " * " + line + "\n";
  text += " */\n";
  text += base::join_text("enum { rheonaut_controller_states = ", count, " };\n\n");
  text += "double rheonaut_controller_step(double state[rheonaut_controller_states], double error_m) {\n";
  for (const std::string& line : statements(CodeLanguage::c, made.sections)) text += "  " + line + "\n";
  if (states(made.sections) == 0) text += "  (void)state;\n";
  return text + "  return duty;\n}\n";
}

std::string matlab_text(const FopdController& controller, const Discretisation& made) {
  std::string text = "function [duty, state] = rheonaut_controller_step(state, error_m)\n";
  for (const std::string& line : head(controller, made)) text += line.empty() ? "%\n" : "% " + line + "\n";
  text += "% Begin with state = []. For MATLAB and Octave.\n";
  text += base::join_text("  if isempty(state)\n    state = zeros(", states(made.sections), ", 1);\n  end\n");
  for (const std::string& line : statements(CodeLanguage::matlab, made.sections)) text += "  " + line + "\n";
  return text + "end\n";
}

}  // namespace

const char* text(CodeLanguage value) { return value == CodeLanguage::c ? "c" : "matlab"; }

std::string controller_code(CodeLanguage language, const FopdController& controller, const Discretisation& made) {
  return language == CodeLanguage::c ? c_text(controller, made) : matlab_text(controller, made);
}

}  // namespace control
