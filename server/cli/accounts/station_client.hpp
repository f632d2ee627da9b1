// Asks the station that runs in a data folder, over loopback and with its own token: for tools that must not write into
// the database themselves. In TLS only the station with the certificate that the folder announces gets the token.
#pragma once

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/cli/accounts/station_answer.hpp"
#include "server/runtime/clock.hpp"

namespace server::cli {

// The body of an answer that is a success. Throws std::runtime_error saying what the station refused.
nlohmann::json asked(StationAnswer answer);

using AskStation =
    std::function<StationAnswer(const std::string& method, const std::string& target, const nlohmann::json& body)>;

// How a tool that waits deals with a station whose places are all taken (503 `busy`): it asks again after a pause, but
// gives up when every answer of the last minute was `busy`.
struct BusyRule {
  std::chrono::milliseconds pause{1000};
  std::chrono::milliseconds longest{60'000};
};

class BusyWait {
 public:
  // `advice`: what has become of what is waited for, and how to ask for it again.
  explicit BusyWait(BusyRule rule = {}, std::string advice = "what was begun goes on without this command")
      : rule_{rule}, advice_{std::move(advice)} {}
  // Whether the answer was `busy`. Any other answer begins the time anew. Throws std::runtime_error when the last other
  // answer was too long ago.
  bool is_busy(const StationAnswer& answer);
  // The same; true after the pause.
  bool asks_again(const StationAnswer& answer);
  void pause();

 private:
  BusyRule rule_;
  std::string advice_;
  boost::asio::io_context loop_;
  runtime::SystemClock clock_{loop_};
  std::int64_t answered_at_us_ = clock_.steady_us();
};

// The advice where a wait for a job ends before the job does.
std::string asks_for_job_again(std::int64_t job, const std::filesystem::path& data_dir);

// By which id the station knows this invocation of a tool: what it begins is kept alive by it alone. Random, unless the
// tool goes on with what an earlier invocation began.
const std::string& invocation_id();
void go_by(std::string id);  // what is no id changes nothing

class StationClient {
 public:
  // Reads endpoints.json and rheonaut.token. Throws std::runtime_error when either is not there.
  explicit StationClient(const std::filesystem::path& data_dir);

  // One connection a request. Throws std::runtime_error when nobody answers in JSON, or not within the limit.
  StationAnswer ask(const std::string& method, const std::string& target, const nlohmann::json& body = nullptr,
                    TimeLimit limit = {}) const;

  // All at the same time, each on a connection of its own, so that none waits for the answer to another. An answer that
  // has not come within `patience` has status 0. Never throws for what the station does.
  std::vector<StationAnswer> ask_at_once(const std::vector<StationRequest>& requests, microseconds patience) const;

  // The body of GET as a file, whatever its size; one that is there is replaced when it is whole. The limit is that of
  // each wait: for its beginning, then for each further part. Throws std::runtime_error saying what the station
  // refused, that nothing came any more, or that it cannot be written.
  void save(const std::string& target, const std::filesystem::path& file, TimeLimit limit) const;

 private:
  std::string advice(TimeLimit limit) const;  // what to do about a station that is silent

  std::filesystem::path data_dir_;
  StationPlace place_;
  std::string token_;
};

}  // namespace server::cli
