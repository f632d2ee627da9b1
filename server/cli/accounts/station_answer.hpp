// A request to the station, its answer, and where it goes: values without HTTP.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace server::cli {

struct StationRequest {
  std::string method;
  std::string target;
  nlohmann::json body = nullptr;
};

struct StationAnswer {
  int status = 0;                 // 0: there is no answer
  nlohmann::json body;            // of an error: problem details; null of a page
  std::string text;               // of what is not JSON; without an answer, why
  bool may_have_arrived = false;  // of a request without an answer: the station may have got it and acted
  bool is_silent = false;         // without an answer: because the time was over
};

// The question gave its place to another client; it is asked again a moment later.
inline bool gave_way(const StationAnswer& answer) {
  constexpr int kUnavailable = 503;
  return answer.status == kUnavailable && answer.body.is_object() && answer.body.value("reason", "") == "busy";
}

// How long a tool waits for the station.
struct TimeLimit {
  std::chrono::microseconds time{std::chrono::seconds{30}};
  bool is_option = false;  // the person can change it by --timeout-s
};

// The limit that the option --timeout-s sets.
inline TimeLimit timeout(double seconds) {
  return {std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::duration<double>{seconds}), true};
}

// Where the station listens.
struct StationPlace {
  boost::asio::ip::tcp::endpoint endpoint;
  std::filesystem::path certificate;  // empty: plain HTTP
};

}  // namespace server::cli
