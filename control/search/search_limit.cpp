// Compares the clock with the deadline, and calls the progress function after a long silence.
#include "control/search/search_limit.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace control {

double steady_now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

SearchLimit::SearchLimit(double limit_s, std::function<bool(const Progress&)> on_progress, Clock clock)
    : on_progress_(std::move(on_progress)),
      clock_(std::move(clock)),
      deadline_s_(clock_() + std::clamp(limit_s, 0.0, 1e6)),
      last_reported_s_(clock_()) {}

void SearchLimit::report(const Progress& progress) {
  progress_ = progress;
  if (end_ != SearchEnd::cancelled) ask_watcher(clock_());
}

bool SearchLimit::is_reached() {
  if (end_) return true;
  const double now_s = clock_();
  if (now_s >= deadline_s_) {
    end_ = SearchEnd::time_limit;
  } else if (now_s - last_reported_s_ >= kMostSilenceS) {
    ask_watcher(now_s);
  }
  return end_.has_value();
}

bool SearchLimit::has_passed() const { return end_ == SearchEnd::time_limit || (!end_ && clock_() >= deadline_s_); }

double SearchLimit::left_s() const { return end_ == SearchEnd::cancelled ? 0 : std::max(0.0, deadline_s_ - clock_()); }

void SearchLimit::ask_watcher(double now_s) {
  last_reported_s_ = now_s;
  if (on_progress_ && !on_progress_(progress_)) end_ = SearchEnd::cancelled;
}

}  // namespace control
