// Holds the samples of a run against the abort criteria of its profile. Pure.
//
// SAFETY: a position counts with two standard deviations, since it is an estimate; without its disturbance, which only
// the controller sees. A value that is no number counts as beyond every bound.
#pragma once

#include <bitset>
#include <cstdint>
#include <optional>
#include <string>

#include "server/experiments/profile.hpp"
#include "server/station/state/station_state.hpp"

namespace server::experiments {

// Why an experiment does not go on: for programs and for people.
struct Abort {
  std::string reason;  // position, position_sd, power, gap, missing_samples, sensor_fault, …: docs/experiments.md
  std::string detail;
};

// SAFETY: a command of the run that the robot accepted for later and then did not do is no step of the run. One that
// the next command of the run replaced before a sample showed it has been done: samples are missing, which is counted.
std::optional<Abort> fault_of(const station::CommandRecord& accepted);

// It came too late, or nobody knows whether it came: no refusal. To a robot that is at rest it is given again.
bool is_late(const station::CommandRecord& record);

class AbortWatch {
 public:
  // `now_us` is steady, here and below.
  AbortWatch(const AbortCriteria& criteria, std::int64_t now_us) : criteria_{criteria}, received_at_us_{now_us} {}

  // In any order: older samples may come after newer ones.
  void on_samples(const station::SampleBatch& batch, std::int64_t now_us);

  // A value beyond its bound; the first of it stays.
  const std::optional<Abort>& fault() const { return found_; }
  // Samples are late, or missing: that may pass.
  std::optional<Abort> late(std::int64_t now_us) const;

 private:
  static constexpr std::size_t kWindow = 1000;  // samples: 10 s

  void judge(const station::SampleBatch& batch, const station::Sample& sample);
  void count(const station::SampleBatch& batch);
  void abort(const char* reason, std::string detail);

  const AbortCriteria criteria_;
  std::optional<Abort> found_;
  std::int64_t received_at_us_;
  station::BootId boot_id_ = 0;
  std::uint64_t first_seq_ = 0, next_seq_ = 0;  // counted from the first batch on
  std::bitset<kWindow> received_;               // of the last kWindow samples before next_seq_, by seq modulo kWindow
  double at_power_s_ = 0;
};

}  // namespace server::experiments
