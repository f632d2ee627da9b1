// Logs and counts exceptions that end something smaller than the station.
//
// An exception ends only the robot's session, connection, request, page, sending of a model or experiment that threw
// it. A client may cause it as often as it likes, so the log has one line a second for each name and text, at most
// kMostNames of them in a second, and one a second for all others of the kind. The counts are in /metrics. Loop thread.
#pragma once

#include <array>
#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <exception>
#include <map>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/runtime/log.hpp"

namespace server::runtime {

// What was ended. `request` is one of HTTP, or a message of a page on /live; `model` the sending of a fluid's model to
// one robot.
enum class Ended : std::uint8_t { robot_session, http_connection, request, live_page, model, experiment };
inline constexpr std::array kAllEnded{Ended::robot_session, Ended::http_connection, Ended::request,
                                      Ended::live_page,     Ended::model,           Ended::experiment};
const char* text(Ended value);

class ExceptionLog {
 public:
  // `which` names the robot, the route or the page. `now_us` is steady.
  void note(Ended ended, const std::string& which, const std::exception_ptr& failure, std::int64_t now_us);

  std::uint64_t count(Ended ended) const { return kinds_[static_cast<std::size_t>(ended)].count; }

 private:
  static constexpr std::size_t kMostNames = 32;
  struct Kind {
    std::uint64_t count = 0;
    std::map<std::string, SparseLines> lines;  // by what the line says
    SparseLines others;
  };
  SparseLines& lines_of(Kind& kind, const std::string& line, std::int64_t now_us);
  std::array<Kind, kAllEnded.size()> kinds_;
};

// A task whose failure is its own: what it throws is noted and ends it alone, never the station. Throws
// operation_aborted when cancelled, and nothing else.
boost::asio::awaitable<void> contained(ExceptionLog& log, const Clock& clock, Ended ended, std::string which,
                                       boost::asio::awaitable<void> task);

// `co_await (a || b)` throws both failures in one when it is cancelled; the first of them is the cause. Each may
// be such a pair itself.
std::exception_ptr first_of(std::exception_ptr failure);

bool is_cancellation(const std::exception_ptr& failure);

// What went wrong, in words for a person (base/failures/words.hpp), also of SQLite: "the disk is full (SQLite 13)".
std::string text_of(const std::exception& failure);
std::string text_of(const std::exception_ptr& failure);

}  // namespace server::runtime
