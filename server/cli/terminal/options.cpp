// Checks on the text of a value, with from_chars, so that neither locale nor hexadecimal nor NaN gets through.
#include "server/cli/terminal/options.hpp"

#include <charconv>
#include <cmath>

namespace server::cli {
namespace {

template <class T>
std::optional<T> parsed(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string refusal(const std::string& allowed, const std::string& text) {
  return fmt::format("must be {}, is {}", allowed, text.empty() ? "empty" : text);
}

template <class Allows>
CLI::Validator number(const std::string& allowed, Allows allows) {
  const auto refuse = [allowed, allows](std::string& text) -> std::string {
    const auto value = parsed<double>(text);
    return value && std::isfinite(*value) && allows(*value) ? std::string{} : refusal(allowed, text);
  };
  return CLI::Validator{refuse, ""};
}

}  // namespace

CLI::Validator finite() {
  return number("a finite number", [](double) { return true; });
}

CLI::Validator positive() {
  return number("positive and finite", [](double value) { return value > 0; });
}

CLI::Validator non_negative() {
  return number("0 or more, and finite", [](double value) { return value >= 0; });
}

CLI::Validator from_to(double low, double high) {
  return number(fmt::format("a number from {:g} to {:g}", low, high),
                [low, high](double value) { return value >= low && value <= high; });
}

CLI::Validator whole(long long low, long long high) {
  const std::string allowed = fmt::format("a whole number from {} to {}", low, high);
  const auto refuse = [low, high, allowed](std::string& text) -> std::string {
    const auto value = parsed<long long>(text);
    return value && *value >= low && *value <= high ? std::string{} : refusal(allowed, text);
  };
  return CLI::Validator{refuse, ""};
}

CLI::Validator named() {
  const auto refuse = [](std::string& text) { return text.empty() ? std::string{"must not be empty"} : std::string{}; };
  return CLI::Validator{refuse, ""};
}

void add_timeout_option(CLI::App& command, double& timeout_s) {
  command
      .add_option("--timeout-s", timeout_s, "Longest wait for the station's answer, or for more of it (default: 600)")
      ->check(from_to(0.1, 86'400));
}

}  // namespace server::cli
