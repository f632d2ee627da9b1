// Looks into exceptions, and writes them down.
#include "server/runtime/exceptions.hpp"

#include <SQLiteCpp/Exception.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sqlite3.h>

#include <boost/asio/error.hpp>
#include <boost/asio/multiple_exceptions.hpp>
#include <boost/system/system_error.hpp>
#include <utility>

#include "base/failures/words.hpp"

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

namespace {

// Null where only SQLite's own text says what it was: such as a statement that this file cannot carry out.
const char* words_of_sqlite(int code) {
  switch (code) {
    case SQLITE_FULL: return "the disk is full";
    case SQLITE_IOERR: return "the disk does not read or write";
    case SQLITE_CORRUPT: return "the file is damaged";
    case SQLITE_NOTADB: return "the file is damaged, or no database";
    case SQLITE_BUSY:
    case SQLITE_LOCKED: return "another program holds the file";
    case SQLITE_READONLY: return "the file may only be read";
    case SQLITE_CANTOPEN: return "the file cannot be opened";
    case SQLITE_NOMEM: return "no memory is left";
    case SQLITE_INTERRUPT: return "it was cancelled";
    default: return nullptr;
  }
}

}  // namespace

std::string text_of(const std::exception& failure) {
  const auto* of_sqlite = dynamic_cast<const SQLite::Exception*>(&failure);
  if (of_sqlite == nullptr) return base::failures::words_of(failure);
  const int code = of_sqlite->getExtendedErrorCode();
  const char* words = code == SQLITE_IOERR_WRITE ? "the disk takes no more: it is full, or fails"
                                                 : words_of_sqlite(of_sqlite->getErrorCode());
  return words != nullptr ? fmt::format("{} (SQLite {})", words, code)
                          : fmt::format("SQLite says '{}' (code {})", failure.what(), code);
}

std::string text_of(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const std::exception& error) {
    return text_of(error);
  } catch (...) {
    return "something that is no exception was thrown";
  }
}

}  // namespace server::runtime
