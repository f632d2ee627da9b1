// Work that a station does for a tool: a job or an experiment is begun, watched to its end, and its answer taken.
//
// While an experiment is watched the tool gives signs of life: the robot stops when they end, so a tool that is
// interrupted leaves nothing moving. Every wait is a request that the station answers after kLookMs at the latest.
// Errors: throws std::runtime_error with what the station refused.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "server/cli/accounts/station_client.hpp"

namespace server::cli {

inline constexpr int kLookMs = 50;  // signs of life are needed every 150 ms
// The pause after a busy answer is no longer than a look, for signs of life go on.
inline constexpr BusyRule kBusyBetweenLooks{.pause = std::chrono::milliseconds{kLookMs}};

// Reports what a job or an experiment says of itself, at each look.
using OnLook = std::function<void(const nlohmann::json& job_or_experiment)>;

class StationWork {
 public:
  StationWork(AskStation ask, OnLook on_look, BusyRule busy = kBusyBetweenLooks)
      : ask_{std::move(ask)}, on_look_{std::move(on_look)}, busy_rule_{busy} {}

  nlohmann::json get(const std::string& target) const { return checked("GET", target, nullptr); }
  nlohmann::json post(const std::string& target, const nlohmann::json& body) const {
    return checked("POST", target, body);
  }

  // As the station answers it, ended: a job with its result, an experiment with its runs.
  nlohmann::json finished_job(std::int64_t job_id) const;
  nlohmann::json finished_experiment(std::int64_t experiment_id) const;
  // An experiment that waits and is held, since its client was away or the station has restarted, is resumed; any other
  // is left as it is.
  void resume_what_was_left(std::int64_t experiment_id) const;

 private:
  nlohmann::json checked(const std::string& method, const std::string& target, const nlohmann::json& body) const;
  std::optional<nlohmann::json> look_at(const std::string& target, BusyWait& busy) const;

  AskStation ask_;
  OnLook on_look_;
  BusyRule busy_rule_;
};

}  // namespace server::cli
