// Looks into exceptions, and writes them down.
#include "server/runtime/exceptions.hpp"

#include <spdlog/spdlog.h>

#include <boost/asio/error.hpp>
#include <boost/asio/multiple_exceptions.hpp>
#include <boost/system/system_error.hpp>
#include <utility>

namespace server::runtime {
namespace asio = boost::asio;

const char* text(Ended value) {
  switch (value) {
    case Ended::robot_session: return "robot_session";
    case Ended::http_connection: return "http_connection";
    case Ended::request: return "request";
    case Ended::live_page: return "live_page";
    case Ended::model: return "model";
    case Ended::experiment: return "experiment";
  }
  return "unknown";
}

void ExceptionLog::note(Ended ended, const std::string& which, const std::exception_ptr& failure, std::int64_t now_us) {
  Kind& kind = kinds_[static_cast<std::size_t>(ended)];
  ++kind.count;
  const std::string line = which + ": " + text_of(failure);
  if (const auto unsaid = lines_of(kind, line, now_us).next(now_us)) spdlog::error("{}{}", line, and_before(*unsaid));
}

// Lines that were not said for a second make room for others; what they left unsaid is in the count.
SparseLines& ExceptionLog::lines_of(Kind& kind, const std::string& line, std::int64_t now_us) {
  if (const auto known = kind.lines.find(line); known != kind.lines.end()) return known->second;
  if (kind.lines.size() == kMostNames) {
    std::erase_if(kind.lines, [now_us](const auto& entry) { return entry.second.is_due(now_us); });
  }
  return kind.lines.size() < kMostNames ? kind.lines[line] : kind.others;
}

asio::awaitable<void> contained(ExceptionLog& log, const Clock& clock, Ended ended, std::string which,
                                asio::awaitable<void> task) {
  std::exception_ptr failure;
  try {
    co_await std::move(task);
  } catch (...) {
    failure = first_of(std::current_exception());
  }
  if (!failure) co_return;
  if (is_cancellation(failure)) std::rethrow_exception(failure);
  log.note(ended, which, failure, clock.steady_us());
}

std::exception_ptr first_of(std::exception_ptr failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const asio::multiple_exceptions& both) {
    return first_of(both.first_exception());
  } catch (...) {
    return failure;
  }
}

bool is_cancellation(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const boost::system::system_error& error) {
    return error.code() == asio::error::operation_aborted;
  } catch (...) {
    return false;
  }
}

std::string text_of(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const std::exception& error) {
    return error.what();
  } catch (...) {
    return "something that is no exception was thrown";
  }
}

}  // namespace server::runtime
