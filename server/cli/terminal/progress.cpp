// One thread, which sleeps between two lines and is woken at the end.
#include "server/cli/terminal/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <thread>
#include <utility>

namespace server::cli {
namespace {

constexpr std::chrono::milliseconds kFirstLine{1000}, kPause{250};
constexpr std::size_t kColumns = 78;  // a longer line would not be rewritten, but scroll

// To a terminal that may have hung up: nothing is to fail for that.
void show(const std::string& text) {
  const std::string line = "\r\x1b[K" + text;
  static_cast<void>(std::fwrite(line.data(), 1, line.size(), stderr));
  static_cast<void>(std::fflush(stderr));
}

}  // namespace

struct Progress::Line {
  explicit Line(std::string name) : what{std::move(name)}, begun{std::chrono::steady_clock::now()} {
    thread = std::thread{[this] { run(); }};
  }
  ~Line() {
    {
      const std::lock_guard lock{mutex};
      has_ended = true;
    }
    wake.notify_one();
    thread.join();
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  void set(std::string text) {
    const std::lock_guard lock{mutex};
    detail = std::move(text);
  }

  void run() {
    std::unique_lock lock{mutex};
    bool is_shown = false;
    for (auto pause = kFirstLine; !wake.wait_for(lock, pause, [this] { return has_ended; }); pause = kPause) {
      const auto seconds =
          std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now() - begun).count();
      const std::string text = one_line(fmt::format("{}: {}{} s", what, detail.empty() ? "" : detail + ", ", seconds));
      lock.unlock();  // a terminal that is held (Ctrl-S) must not hold the work
      show(text.substr(0, kColumns));
      lock.lock();
      is_shown = true;
    }
    lock.unlock();
    if (is_shown) show("");
  }

  const std::string what;
  const std::chrono::steady_clock::time_point begun;
  std::mutex mutex;
  std::condition_variable wake;
  std::string detail;
  bool has_ended = false;
  std::thread thread;
};

Progress::Progress(std::string what, const OutputForm& form) {
  if (!form.is_json && ::isatty(STDERR_FILENO) != 0) line_ = std::make_unique<Line>(std::move(what));
}

Progress::~Progress() = default;

void Progress::set_share(double share) {
  constexpr double kPercent = 100;
  if (line_) line_->set(fmt::format("{:.0f} %", kPercent * share));
}

void Progress::set_detail(std::string detail) {
  if (line_) line_->set(std::move(detail));
}

}  // namespace server::cli
