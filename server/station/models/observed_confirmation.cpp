#include "server/station/models/observed_confirmation.hpp"

namespace server::station {

bool ObservedConfirmation::on_flag(BootId boot_id, bool flag, std::int64_t now_us) {
  if (boot_id_ == boot_id && flag_ == flag) return false;
  if (boot_id_ != boot_id) {
    boot_id_ = boot_id;
    flag_.reset();
    page_before_seq_ = 0;
  }
  was_seen_to_rise_ = flag_.has_value();
  flag_ = flag;
  known_since_us_ = now_us;
  return true;
}

void ObservedConfirmation::on_page(std::uint64_t first_seq, std::int64_t now_us) {
  page_before_seq_ = first_seq;
  page_came_us_ = now_us;
}

}  // namespace server::station
