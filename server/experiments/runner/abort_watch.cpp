#include "server/experiments/runner/abort_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

namespace server::experiments {
namespace {

constexpr double kPowerDuty = 0.9;
constexpr const char* kDutyAdvice =
    ": the motor does not take every duty of the profile; one that runs one way only takes none below 0";

}  // namespace

void AbortWatch::abort(const char* reason, std::string detail) {
  if (!found_) found_ = Abort{reason, std::move(detail)};
}

std::optional<Abort> fault_of(const station::CommandRecord& accepted) {
  using station::CommandState;
  const bool is_unseen = accepted.state == CommandState::superseded && accepted.reason == "by_a_newer_command" &&
                         accepted.acknowledged_after_us >= 0;
  const bool has_failed = accepted.state == CommandState::rejected || accepted.state == CommandState::expired ||
                          accepted.state == CommandState::failed || accepted.state == CommandState::superseded;
  if (!has_failed || is_unseen) return std::nullopt;
  const std::string state = text(accepted.state);
  const std::string reason = accepted.reason.empty() || accepted.reason == state ? "" : ", " + accepted.reason;
  const bool is_duty = accepted.kind == "set_duty" || accepted.kind == "set_duty_schedule";
  const char* advice = is_duty && accepted.reason == "out_of_range" ? kDutyAdvice : "";
  return Abort{"command_refused", fmt::format("{}: {}{}{}", accepted.kind, state, reason, advice)};
}

bool is_late(const station::CommandRecord& record) {
  constexpr std::array<std::string_view, 6> kUnheard{"expired",       "link_lost",        "no_answer",
                                                     "not_connected", "not_sent_in_time", "too_old_on_arrival"};
  const bool has_no_reason = record.state == station::CommandState::expired && record.reason.empty();
  return has_no_reason || std::ranges::find(kUnheard, record.reason) != kUnheard.end();
}

void AbortWatch::on_samples(const station::SampleBatch& batch, std::int64_t now_us) {
  if (boot_id_ == 0) {
    // What was made before it, and is still on its way, says nothing of the run.
    if ((batch.context.flags & rheonaut_TELEMETRY_FLAG_BACKFILL) != 0) return;
    boot_id_ = batch.boot_id;
    first_seq_ = next_seq_ = batch.first_seq;
  }
  if (batch.boot_id != boot_id_) return abort("reboot", "the robot has booted again");
  received_at_us_ = now_us;
  const bool is_newest = batch.next_seq() > next_seq_;
  count(batch);
  if (!is_newest) return;
  for (const station::Sample& sample : batch.samples) judge(batch, sample);
  if (criteria_.sensor_fault && (batch.context.flags & rheonaut_TELEMETRY_FLAG_SENSOR_FAULT) != 0) {
    abort("sensor_fault", "the robot reports a sensor that cannot be believed");
  }
}

void AbortWatch::count(const station::SampleBatch& batch) {
  for (std::uint64_t seq = next_seq_; seq < batch.next_seq() && seq - next_seq_ < kWindow; ++seq) {
    received_.reset(seq % kWindow);
  }
  if (batch.next_seq() > next_seq_ + kWindow) received_.reset();
  next_seq_ = std::max(next_seq_, batch.next_seq());
  for (std::uint64_t seq = batch.first_seq; seq < batch.next_seq(); ++seq) {
    if (seq >= first_seq_ && seq + kWindow >= next_seq_) received_.set(seq % kWindow);
  }
}

void AbortWatch::judge(const station::SampleBatch& batch, const station::Sample& sample) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  const auto sd_m = static_cast<double>(batch.context.position_sd_m.value_or(kNone));
  const auto disturbance_m = static_cast<double>(batch.context.disturbance_m.value_or(kNone));
  const double position_m = static_cast<double>(sample.position_m) - disturbance_m;
  if (!(position_m - 2 * sd_m >= criteria_.position_min_m)) {
    abort("position", fmt::format("the position, {:.3f} ± {:.3f} m, may be below abort.position_min_m = {} m",
                                  position_m, 2 * sd_m, criteria_.position_min_m));
  }
  if (!(position_m + 2 * sd_m <= criteria_.position_max_m)) {
    abort("position", fmt::format("the position, {:.3f} ± {:.3f} m, may be above abort.position_max_m = {} m",
                                  position_m, 2 * sd_m, criteria_.position_max_m));
  }
  if (!(sd_m <= criteria_.position_sd_max_m)) {
    abort("position_sd", fmt::format("the position is known to ± {:.3f} m (sd), abort.position_sd_max_m is {} m", sd_m,
                                     criteria_.position_sd_max_m));
  }
  at_power_s_ = std::abs(static_cast<double>(sample.duty)) > kPowerDuty ? at_power_s_ + kTick_s : 0;
  if (at_power_s_ > criteria_.power_s) {
    abort("power", fmt::format("the duty was beyond {} for {:.2f} s, abort.power_s is {} s", kPowerDuty, at_power_s_,
                               criteria_.power_s));
  }
}

std::optional<Abort> AbortWatch::late(std::int64_t now_us) const {
  const double gap_s = static_cast<double>(now_us - received_at_us_) / 1e6;
  if (gap_s > criteria_.gap_s) {
    return Abort{"gap", fmt::format("no sample came for {:.2f} s, abort.gap_s is {} s", gap_s, criteria_.gap_s)};
  }
  const std::uint64_t expected = std::min<std::uint64_t>(next_seq_ - first_seq_, kWindow);
  const double missing_share = static_cast<double>(expected - std::min<std::uint64_t>(received_.count(), expected)) /
                               static_cast<double>(kWindow);
  if (missing_share > criteria_.missing_share) {
    return Abort{"missing_samples", fmt::format("of the samples of the last 10 s {:.1f} % are missing, "
                                                "abort.missing_share is {:.1f} %",
                                                100 * missing_share, 100 * criteria_.missing_share)};
  }
  return std::nullopt;
}

}  // namespace server::experiments
