// Chooses the next message.
#include "robot_fw/core/outbox.hpp"

#include <algorithm>

namespace robot_fw {
namespace {

using protocol::kMaxSamplesPerFrame;

constexpr std::uint64_t kStatusPeriodUs = 1'000'000;
constexpr std::uint64_t kMaxLiveBacklog = 100;  // samples; what is older is no longer live
constexpr std::size_t kBackfillPerTick = 2;     // samples, against the one that is made
constexpr std::size_t kMaxBackfillCredit = 2 * kMaxSamplesPerFrame;
constexpr std::uint64_t kLow48 = (1ULL << 48) - 1;

}  // namespace

void SampleRun::extend(std::uint64_t from_seq, std::uint64_t to_seq) {
  if (from_seq >= to_seq) return;
  next_seq = empty() ? from_seq : std::min(next_seq, from_seq);
  end_seq = std::max(end_seq, to_seq);
}

void Outbox::welcomed(const TelemetryRing& samples, const EventRing& events) {
  backfill_ = {samples.oldest_seq(), samples.next_seq()};
  backfill_credit_ = 0;
  live_ = {samples.next_seq(), samples.next_seq()};
  event_next_ = events.oldest_seq();
  heartbeat_ = rheonaut_Heartbeat_init_zero;
  stop_probe_us_ = 0;
  status_due_us_ = 0;
  page_count_ = 0;  // those of commands of an earlier connection
  controller_due_ = true;
  table_index_ = 0;
}

PageRequest Outbox::table_page() const {
  return {0, table_index_, std::min(PageRequest::kMost, kParameterCount - table_index_)};
}

Outbox::Ack::Ack(const protocol::CommandAck& ack)
    : command_id(ack.command_id),
      emergency_id(ack.emergency_id),
      effect_at_robot_us(ack.effect_at_robot_us & kLow48),
      result(static_cast<std::uint8_t>(ack.result)),
      reason(static_cast<std::uint8_t>(ack.reason)) {}

protocol::CommandAck Outbox::first_ack() const {
  const Ack& first = acks_[first_ack_];
  protocol::CommandAck ack = rheonaut_CommandAck_init_zero;
  ack.command_id = first.command_id;
  ack.result = static_cast<protocol::CommandResult>(first.result);
  ack.reason = static_cast<protocol::RejectReason>(first.reason);
  ack.effect_at_robot_us = first.effect_at_robot_us;
  ack.emergency_id = first.emergency_id;
  return ack;
}

void Outbox::ack(const protocol::CommandAck& ack) {
  if (stop_acks_ == kMaxAcks) return;  // SAFETY: no other ack displaces a stop's
  if (ack_count_ == kMaxAcks) drop_oldest_ordinary_ack();
  acks_[(first_ack_ + ack_count_++) % kMaxAcks] = Ack{ack};
}

void Outbox::ack_stop(const protocol::CommandAck& ack) {
  if (ack_count_ == kMaxAcks && stop_acks_ < kMaxAcks) drop_oldest_ordinary_ack();
  first_ack_ = (first_ack_ + kMaxAcks - 1) % kMaxAcks;
  acks_[first_ack_] = Ack{ack};
  ack_count_ = std::min(ack_count_ + 1, kMaxAcks);
  stop_acks_ = std::min(stop_acks_ + 1, kMaxAcks);
}

// The first one behind the stops'; those behind it move up.
void Outbox::drop_oldest_ordinary_ack() {
  for (std::size_t i = stop_acks_; i + 1 < ack_count_; ++i) {
    acks_[(first_ack_ + i) % kMaxAcks] = acks_[(first_ack_ + i + 1) % kMaxAcks];
  }
  --ack_count_;
}

void Outbox::echo(std::uint64_t station_time_us, std::uint64_t received_at_us) {
  heartbeat_.echo_station_time_us = station_time_us;
  heartbeat_.echo_received_at_robot_us = received_at_us;
}

void Outbox::sample_made(const TelemetryRing& samples, bool urgent) {
  if (urgent) live_.end_seq = samples.next_seq();
  if (samples.next_seq() > live_.next_seq + kMaxLiveBacklog) {
    backfill_.extend(live_.next_seq, samples.next_seq() - 1);
    live_.next_seq = samples.next_seq() - 1;
  }
  backfill_credit_ = std::min(backfill_credit_ + kBackfillPerTick, kMaxBackfillCredit);
}

// Skips what the rings have given up or the station has by now.
void Outbox::catch_up(const TelemetryRing& samples, const EventRing& events) {
  event_next_ = std::clamp(event_next_, events.oldest_seq(), events.next_seq());
  live_.next_seq = std::max(live_.next_seq, samples.oldest_seq());
  backfill_.next_seq = std::max(backfill_.next_seq, samples.oldest_seq());
  backfill_.end_seq = std::min(backfill_.end_seq, samples.next_seq());
}

Outgoing Outbox::next(const Link& link, const TelemetryRing& samples, const EventRing& events,
                      std::uint32_t samples_per_frame, std::uint64_t now_us) {
  if (link.phase() == Link::Phase::closed) return Outgoing::none;
  if (hello_due_) return Outgoing::hello;
  if (stop_acks_ > 0) return Outgoing::ack;
  if (!link.up()) return Outgoing::none;
  if (stop_probe_us_ != 0) return Outgoing::stop_probe_answer;
  catch_up(samples, events);
  if (ack_count_ > 0) return Outgoing::ack;
  if (page_count_ > 0) return Outgoing::parameters;
  if (controller_due_) return Outgoing::controller;
  if (event_next_ < events.next_seq()) return Outgoing::event;
  const bool some_are_urgent = !live_.empty() && live_.next_seq < samples.next_seq();
  if (some_are_urgent || samples.next_seq() - live_.next_seq >= samples_per_frame) return Outgoing::live;
  if (now_us >= status_due_us_) return Outgoing::status;
  if (heartbeat_.echo_station_time_us != 0 || link.heartbeat_due(now_us)) return Outgoing::heartbeat;
  if (table_index_ < kParameterCount) return Outgoing::table;
  if (backfill_.empty()) return Outgoing::none;
  const std::uint64_t wanted = std::min<std::uint64_t>(backfill_.end_seq - backfill_.next_seq, kMaxSamplesPerFrame);
  return wanted <= backfill_credit_ ? Outgoing::backfill : Outgoing::none;
}

void Outbox::sent(Outgoing what, std::size_t samples_in_frame, std::uint64_t now_us) {
  switch (what) {
    case Outgoing::none: break;
    case Outgoing::hello: hello_due_ = false; break;
    case Outgoing::ack:
      if (stop_acks_ > 0) --stop_acks_;
      first_ack_ = (first_ack_ + 1) % kMaxAcks;
      --ack_count_;
      break;
    case Outgoing::stop_probe_answer: stop_probe_us_ = 0; break;
    case Outgoing::parameters:
      std::copy(pages_.begin() + 1, pages_.end(), pages_.begin());
      --page_count_;
      break;
    case Outgoing::controller: controller_due_ = false; break;
    case Outgoing::event: ++event_next_; break;
    case Outgoing::live: live_.next_seq += samples_in_frame; break;
    case Outgoing::status: status_due_us_ = now_us + kStatusPeriodUs; break;
    case Outgoing::heartbeat: heartbeat_ = rheonaut_Heartbeat_init_zero; break;
    case Outgoing::table: table_index_ = static_cast<std::uint8_t>(table_index_ + table_page().count); break;
    case Outgoing::backfill:
      backfill_.next_seq += samples_in_frame;
      backfill_credit_ -= std::min(samples_in_frame, backfill_credit_);
      break;
  }
}

}  // namespace robot_fw
