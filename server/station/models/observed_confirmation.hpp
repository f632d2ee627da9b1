// What telemetry and the pages of parameters have shown so far of a robot's confirmation of its model.
//
// Times are steady times of the station. Loop thread.
#pragma once

#include <cstdint>
#include <optional>

#include "server/station/state/station_state.hpp"

namespace server::station {

class ObservedConfirmation {
 public:
  static constexpr std::int64_t kPatienceUs = 5'000'000;  // for what belongs to a report and has not come yet

  // A live batch. True when it shows another boot or another flag than the one before.
  bool on_flag(BootId boot_id, bool flag, std::int64_t now_us);
  // A page of parameters; `first_seq` is the first sample made after it.
  void on_page(std::uint64_t first_seq, std::int64_t now_us);
  // SAFETY: of a command that was on its way when the link broke nobody knows whether it has run.
  void on_disconnected() { flag_.reset(); }

  BootId boot_id() const { return boot_id_; }                  // of the latest batch; 0: none yet
  std::optional<bool> flag() const { return flag_; }           // the model is confirmed; none: not known
  bool was_seen_to_rise() const { return was_seen_to_rise_; }  // in this boot and link, by two batches
  // The flag was first known a short time ago, so the parameters may still be on their way.
  bool is_new(std::int64_t now_us) const { return now_us < known_since_us_ + kPatienceUs; }
  // The page of a changed parameter comes before the sample that shows what the change has done to the confirmation.
  bool is_older_than_page(std::uint64_t next_seq, std::int64_t now_us) const {
    return next_seq <= page_before_seq_ && now_us < page_came_us_ + kPatienceUs;
  }

 private:
  BootId boot_id_ = 0;
  std::optional<bool> flag_;
  bool was_seen_to_rise_ = false;
  std::int64_t known_since_us_ = 0;
  std::uint64_t page_before_seq_ = 0;  // the first sample made after the newest page of parameters
  std::int64_t page_came_us_ = 0;
};

}  // namespace server::station
