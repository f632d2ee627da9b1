// What waits to be sent to one Foxglove client, bounded however slowly it reads.
//
// At most kMaxData messages of channels and kMaxDataBytes of them wait: the oldest are dropped first, and counted; the
// client gets a status with the number, at most one a second. At most kMaxStatuses statuses wait, further ones are
// left out. Of what must not be lost (the channels) at most kMaxLasting wait: then the client is overrun, and its
// connection is to end. Loop thread.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "server/live/foxglove/server_message.hpp"
#include "server/runtime/clock.hpp"

namespace server::live::foxglove {

using SharedText = std::shared_ptr<const std::string>;
inline SharedText shared(std::string text) { return std::make_shared<const std::string>(std::move(text)); }

struct Outgoing {
  std::optional<DataHead> head;  // of message data, which is binary; none: a text
  SharedText body;
};

class OutgoingQueue {
 public:
  static constexpr std::size_t kMaxData = 2048;
  static constexpr std::size_t kMaxDataBytes = 2 * 1024 * 1024;
  static constexpr std::size_t kMaxStatuses = 32;
  static constexpr std::size_t kMaxLasting = 512;

  OutgoingQueue(boost::asio::io_context& loop, runtime::Clock& clock) : clock_{clock}, arrived_{loop} {}

  void push_lasting(std::string text);
  void push_status(StatusLevel level, const std::string& message);
  void push_data(SubscriptionId subscription, std::uint64_t log_time_ns, SharedText body);
  // Forgets what waits of a subscription, which ended.
  void drop(SubscriptionId subscription);

  boost::asio::awaitable<void> wait();  // until something may wait; throws operation_aborted when cancelled
  void wake() { arrived_.notify(); }
  std::optional<Outgoing> pop();  // none waits

  bool is_overrun() const { return is_overrun_; }  // for good: a message that must arrive is lost
  std::size_t size() const { return queue_.size(); }
  std::uint64_t dropped() const { return dropped_; }  // so far

 private:
  enum class Kind : std::uint8_t { lasting, status, data };
  struct Entry {
    Kind kind;
    SubscriptionId subscription = 0;
    Outgoing outgoing;
  };

  void push(Entry entry);
  void forget(const Entry& entry);
  void drop_oldest();

  runtime::Clock& clock_;
  runtime::Signal arrived_;
  std::deque<Entry> queue_;
  bool is_overrun_ = false;
  std::size_t lasting_ = 0, statuses_ = 0, data_ = 0, data_bytes_ = 0;
  std::uint64_t dropped_ = 0, reported_ = 0;
  std::int64_t report_due_us_ = 0;  // steady
};

}  // namespace server::live::foxglove
