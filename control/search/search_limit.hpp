// Ends a search after its time limit, or when the progress function cancels it; long steps check it, too.
//
// Once reached it stays reached. What was found until then depends on how fast the machine was, so it is no result:
// every search that gives one has ended by its counts of starts and iterations. The progress function is called after
// every iteration, and at least each kMostSilenceS while the search checks.
#pragma once

#include <functional>
#include <optional>

#include "control/search/fit.hpp"

namespace control {

class SearchLimit {
 public:
  using Clock = std::function<double()>;  // seconds from any origin
  static constexpr double kMostSilenceS = 0.1;

  SearchLimit(double limit_s, std::function<bool(const Progress&)> on_progress, Clock clock);

  void begin(const Progress& progress) { progress_ = progress; }
  void report(const Progress& progress);  // calls the progress function at once
  bool is_reached();
  std::optional<SearchEnd> end() const { return end_; }
  bool has_passed() const;  // the time limit, also where no step of the search has checked it since
  double left_s() const;

 private:
  void ask_watcher(double now_s);

  std::function<bool(const Progress&)> on_progress_;
  Clock clock_;
  double deadline_s_, last_reported_s_;
  Progress progress_;
  std::optional<SearchEnd> end_;
};

// Of std::chrono::steady_clock.
double steady_now_s();

}  // namespace control
