// Counts by kind, and drops data.
#include "server/live/foxglove/outgoing_queue.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace server::live::foxglove {
namespace {
constexpr std::int64_t kReportIntervalUs = 1'000'000;
}  // namespace

void OutgoingQueue::push_lasting(std::string text) {
  if (lasting_ == kMaxLasting) is_overrun_ = true;
  if (is_overrun_) return;
  ++lasting_;
  push({Kind::lasting, 0, {std::nullopt, shared(std::move(text))}});
}

void OutgoingQueue::push_status(StatusLevel level, const std::string& message) {
  if (statuses_ == kMaxStatuses) return;
  ++statuses_;
  push({Kind::status, 0, {std::nullopt, shared(status_message(level, message))}});
}

void OutgoingQueue::push_data(SubscriptionId subscription, std::uint64_t log_time_ns, SharedText body) {
  ++data_;
  data_bytes_ += body->size();
  push({Kind::data, subscription, {data_head(subscription, log_time_ns), std::move(body)}});
  while (data_ > kMaxData || (data_bytes_ > kMaxDataBytes && data_ > 1)) drop_oldest();
}

void OutgoingQueue::push(Entry entry) {
  queue_.push_back(std::move(entry));
  arrived_.notify();
}

void OutgoingQueue::forget(const Entry& entry) {
  switch (entry.kind) {
    case Kind::lasting: --lasting_; break;
    case Kind::status: --statuses_; break;
    case Kind::data:
      --data_;
      data_bytes_ -= entry.outgoing.body->size();
      break;
  }
}

void OutgoingQueue::drop_oldest() {
  const auto oldest = std::ranges::find(queue_, Kind::data, &Entry::kind);
  forget(*oldest);
  queue_.erase(oldest);
  ++dropped_;
}

void OutgoingQueue::drop(SubscriptionId subscription) {
  std::erase_if(queue_, [&](const Entry& entry) {
    const bool is_of_it = entry.kind == Kind::data && entry.subscription == subscription;
    if (is_of_it) forget(entry);
    return is_of_it;
  });
}

boost::asio::awaitable<void> OutgoingQueue::wait() { return arrived_.wait(); }

std::optional<Outgoing> OutgoingQueue::pop() {
  if (dropped_ != reported_ && clock_.steady_us() >= report_due_us_) {
    reported_ = dropped_;
    report_due_us_ = clock_.steady_us() + kReportIntervalUs;
    const std::string text =
        fmt::format("{} messages were left out since the connection began: this client reads too slowly", dropped_);
    return Outgoing{std::nullopt, shared(status_message(StatusLevel::warning, text, "dropped"))};
  }
  if (queue_.empty()) return std::nullopt;
  const Entry entry = std::move(queue_.front());
  queue_.pop_front();
  forget(entry);
  return entry.outgoing;
}

}  // namespace server::live::foxglove
