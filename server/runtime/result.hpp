// Expected failures in the station as values: a code and a sentence.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <utility>

namespace server {

// The HTTP status of each code stands in one table in api/json.cpp.
enum class ErrorCode : std::uint8_t {
  bad_request,   // malformed
  invalid,       // well-formed, but a value is out of range: `detail` says the limit
  unauthorized,  // no valid credential
  forbidden,     // a valid credential that may not do this
  not_found,
  conflict,       // the state forbids it now
  rejected,       // the robot refused the command
  not_connected,  // the robot is not connected
  timed_out,      // no answer in time
  unavailable,    // the station cannot do it now (queue full, stopping)
  internal,
};

struct Error {
  ErrorCode code = ErrorCode::internal;
  std::string detail;  // what, which value, what to do
  std::string reason;  // for programs, e.g. "wrong_mode"; may be empty
};

template <class T>
using Result = std::expected<T, Error>;

inline std::unexpected<Error> fail(ErrorCode code, std::string detail, std::string reason = {}) {
  return std::unexpected<Error>{std::in_place, code, std::move(detail), std::move(reason)};
}

}  // namespace server
