#include "server/experiments/runner/stubborn_writer.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <stdexcept>

#include "server/runtime/exceptions.hpp"

namespace server::experiments {
namespace {

constexpr microseconds kAgainAfter = std::chrono::seconds{1};

// Whether the error is of a disk that is full, slow, busy or away; any other would come for ever.
bool may_pass(const SQLite::Exception& error) {
  switch (error.getErrorCode()) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_FULL:
    case SQLITE_IOERR:
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
    case SQLITE_NOMEM: return true;
    default: return false;
  }
}

struct Outcome {
  std::string problem;  // empty: it is stored
  bool may_pass = false;
};

}  // namespace

// One that is at it, from its request to its end.
class StubbornWriter::Turn {
 public:
  explicit Turn(StubbornWriter& writer) : writer_{writer}, number_{writer.next_turn_++} {
    writer_.turns_.insert(number_);
  }
  ~Turn() {
    writer_.turns_.erase(number_);
    writer_.moved_.notify();
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

  bool is_mine() const { return *writer_.turns_.begin() == number_; }

 private:
  StubbornWriter& writer_;
  std::uint64_t number_;
};

boost::asio::awaitable<void> StubbornWriter::keep(std::string what, std::function<void(storage::Database&)> change) {
  const Turn turn{*this};
  while (!turn.is_mine()) co_await moved_.wait();
  for (;;) {
    auto job = [change](storage::Database& database) -> Outcome {
      try {
        change(database);
        return {};
      } catch (const SQLite::Exception& error) {
        return {runtime::text_of(error), may_pass(error)};
      }
    };
    const Outcome outcome = co_await recorder_.on_disk(std::move(job));
    if (outcome.problem.empty()) co_return;
    if (!outcome.may_pass) throw std::runtime_error{fmt::format("{} cannot be stored: {}", what, outcome.problem)};
    spdlog::error("{} cannot be stored: {}; it is tried again", what, outcome.problem);
    co_await clock_.sleep_for(kAgainAfter);
  }
}

}  // namespace server::experiments
