// The words that a running proxy obeys.
#include <charconv>
#include <cmath>
#include <functional>
#include <map>
#include <sstream>
#include <stdexcept>

#include "sim_robot/proxy/proxy.hpp"

namespace sim_robot {
namespace {

using Words = std::vector<std::string>;

constexpr double kMaxOutageS = 86'400;

Words words_of(const std::string& line) {
  std::istringstream stream{line};
  Words words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

double number(const Words& words, double max) {
  if (words.size() < 2) throw std::invalid_argument("'" + words[0] + "' needs a number");
  const std::string& text = words[1];
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool good = error == std::errc{} && end == text.data() + text.size() && value >= 0 && value <= max;
  if (!good) throw std::invalid_argument("'" + text + "' is not a number of 0 or more that '" + words[0] + "' takes");
  return value;
}

std::size_t count(const Words& words) {
  const double value = number(words, 1e9);
  if (value != std::floor(value)) throw std::invalid_argument("'" + words[1] + "' is not a whole number");
  return static_cast<std::size_t>(value);
}

Direction direction(const Words& words) {
  if (words.size() < 2 || words[1] == "both") return Direction::both;
  if (words[1] == "up") return Direction::up;
  if (words[1] == "down") return Direction::down;
  throw std::invalid_argument("'" + words[1] + "' is not up, down or both");
}

bool then_reset(const Words& words) {
  if (words.size() < 3) return false;
  if (words[2] != "reset") throw std::invalid_argument("'" + words[2] + "' is not reset");
  return true;
}

struct Word {
  std::size_t most_arguments;
  std::function<void(Proxy&, const Words&)> obey;
};

Word setting(std::function<void(Impairment&, const Words&)> change) {
  return {1, [change = std::move(change)](Proxy& proxy, const Words& words) {
            LinkImpairments next = proxy.impairments();
            change(next.up, words);
            change(next.down, words);
            proxy.impair(next.up, next.down);
          }};
}

const std::map<std::string, Word>& vocabulary() {
  constexpr double kMaxMs = 1e3 * kMaxOutageS;
  static const std::map<std::string, Word> kWords{
      {"cut", {1, [](Proxy& proxy, const Words& line) { proxy.cut(line.size() < 2 ? 0 : count(line)); }}},
      {"reset", {0, [](Proxy& proxy, const Words&) { proxy.reset(); }}},
      {"half-open", {1, [](Proxy& proxy, const Words& line) { proxy.half_open(direction(line)); }}},
      {"outage",
       {2, [](Proxy& proxy, const Words& line) { proxy.outage(number(line, kMaxOutageS), then_reset(line)); }}},
      {"heal", {0, [](Proxy& proxy, const Words&) { proxy.heal(); }}},
      {"delay", setting([](Impairment& to, const Words& line) { to.delay_s = 1e-3 * number(line, kMaxMs); })},
      {"jitter", setting([](Impairment& to, const Words& line) { to.jitter_s = 1e-3 * number(line, kMaxMs); })},
      {"throttle", setting([](Impairment& to, const Words& line) { to.bytes_per_s = number(line, 1e12); })},
      {"loss", setting([](Impairment& to, const Words& line) { to.loss_probability = number(line, 1); })},
      {"split", setting([](Impairment& to, const Words& line) { to.split_bytes = count(line); })}};
  return kWords;
}

std::string all_words() {
  std::string all;
  for (const auto& [word, unused] : vocabulary()) all += (all.empty() ? "" : ", ") + word;
  return all;
}

}  // namespace

std::string Proxy::control(const std::string& line) {
  const Words words = words_of(line);
  if (words.empty()) return "say one of: " + all_words();
  const auto word = vocabulary().find(words[0]);
  if (word == vocabulary().end()) return "unknown word '" + words[0] + "'; say one of: " + all_words();
  if (words.size() - 1 > word->second.most_arguments) return "too many words after '" + words[0] + "'";
  try {
    word->second.obey(*this, words);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  std::string done = "ok:";
  for (const std::string& each : words) done += " " + each;
  return done;
}

}  // namespace sim_robot
