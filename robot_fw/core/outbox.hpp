// Decides what is sent next: the order of the messages, and how far each sequence has been sent.
//
// First to last: hello, acks of stops, answer to a stop probe, acks, requested parameters and controller, events, live
// samples, status, heartbeat, what is in force (after a Welcome), backfill. Backfill: samples from before this
// connection that the station lacks, or that it requests again; at most twice the rate of the live samples.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/messages.hpp"
#include "robot_fw/core/event_ring.hpp"
#include "robot_fw/core/link.hpp"
#include "robot_fw/core/parameters.hpp"
#include "robot_fw/core/telemetry_ring.hpp"

namespace robot_fw {

enum class Outgoing {
  none,
  hello,
  ack,
  stop_probe_answer,
  parameters,
  controller,
  event,
  live,
  status,
  heartbeat,
  table,
  backfill
};

// A run of samples still to be sent: [next_seq, end_seq).
struct SampleRun {
  std::uint64_t next_seq = 0;
  std::uint64_t end_seq = 0;

  bool empty() const { return next_seq >= end_seq; }
  void extend(std::uint64_t from_seq, std::uint64_t to_seq);
};

// A page of the parameter table, as the answer to a command; command 0: sent without a request.
struct PageRequest {
  static constexpr std::size_t kMost = sizeof(protocol::ParameterPage::parameters) / sizeof(rheonaut_Parameter);

  std::uint64_t command_id = 0;
  std::size_t first_index = 0;
  std::size_t count = 0;
};

class Outbox {
 public:
  static constexpr std::size_t kMaxAcks = 8;
  static constexpr std::size_t kMaxPages = 4;

  // A new connection: hello first. Acks that were not sent stay due.
  void opened() { hello_due_ = true; }
  // The station answers: samples in the rings are backfill, later ones are live.
  void welcomed(const TelemetryRing& samples, const EventRing& events);
  void resend(std::uint64_t first_seq, std::uint64_t end_seq) { backfill_.extend(first_seq, end_seq); }
  void resend_events(const EventRing& events) { event_next_ = events.oldest_seq(); }

  // A full queue drops its oldest ack that does not answer a stop. If all answer stops, this ack is dropped; the
  // station then repeats the command.
  void ack(const protocol::CommandAck& ack);
  // Ahead of every other ack, and already before Welcome. Always kept; a queue full of acks of stops drops its oldest.
  void ack_stop(const protocol::CommandAck& ack);
  // There must be room for it.
  void ask_page(const PageRequest& page) { pages_[page_count_++] = page; }
  bool has_room_for_pages(std::size_t pages) const { return page_count_ + pages <= kMaxPages; }
  void controller_changed() { controller_due_ = true; }
  void echo(std::uint64_t station_time_us, std::uint64_t received_at_us);
  // SAFETY: behind the acks of stops and ahead of all else, so that it takes as long as the ack of a stop would.
  void answer_stop_probe(std::uint64_t station_time_us) { stop_probe_us_ = station_time_us; }
  // Once per tick, after the sample was made; `urgent` sends it, and all before it, at once.
  void sample_made(const TelemetryRing& samples, bool urgent);

  // The first message that is due; nothing changes until sent() confirms it.
  Outgoing next(const Link& link, const TelemetryRing& samples, const EventRing& events,
                std::uint32_t samples_per_frame, std::uint64_t now_us);
  // The message that next() named was written. `samples_in_frame` counts for telemetry.
  void sent(Outgoing what, std::size_t samples_in_frame, std::uint64_t now_us);

  protocol::CommandAck first_ack() const;
  const PageRequest& first_page() const { return pages_[0]; }
  PageRequest table_page() const;
  std::uint64_t event_seq() const { return event_next_; }
  std::uint64_t live_seq() const { return live_.next_seq; }
  const SampleRun& backfill() const { return backfill_; }
  const protocol::Heartbeat& heartbeat() const { return heartbeat_; }
  std::uint64_t stop_probe_us() const { return stop_probe_us_; }

 private:
  void catch_up(const TelemetryRing& samples, const EventRing& events);
  void drop_oldest_ordinary_ack();

  // An acknowledgement in little room: every enumerator is below 256, 48 bits of microseconds are 8 years.
  struct Ack {
    Ack() = default;
    explicit Ack(const protocol::CommandAck& ack);

    std::uint64_t command_id = 0;
    std::uint64_t emergency_id = 0;
    std::uint64_t effect_at_robot_us : 48;
    std::uint64_t result : 8;
    std::uint64_t reason : 8;
  };
  static_assert(sizeof(Ack) == 24, "an acknowledgement outgrew its place");

  bool hello_due_ = false;
  std::array<Ack, kMaxAcks> acks_{};
  std::size_t first_ack_ = 0, ack_count_ = 0;
  std::size_t stop_acks_ = 0;  // how many of them, the first ones, answer a stop
  std::array<PageRequest, kMaxPages> pages_{};
  std::size_t page_count_ = 0;
  bool controller_due_ = false;
  std::uint8_t table_index_ = 0;  // of the parameter with which the table goes on; at its end nothing is due
  std::uint64_t event_next_ = 0;
  SampleRun live_;  // end_seq: samples below it are due at once
  SampleRun backfill_;
  std::size_t backfill_credit_ = 0;  // samples that may be sent now
  protocol::Heartbeat heartbeat_{};  // the answer to a clock probe, zero when none is due
  std::uint64_t stop_probe_us_ = 0;  // to be echoed; 0: none
  std::uint64_t status_due_us_ = 0;
};

}  // namespace robot_fw
