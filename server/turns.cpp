// Rounds: each grants a few turns, and the next begins when the loop has looked at its sockets.
#include "server/turns.hpp"

#include <algorithm>
#include <boost/asio/async_result.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

namespace server {
namespace asio = boost::asio;

bool Turns::take() {
  if (taken_ >= at_once_ || !waiting_.empty()) return false;
  ++taken_;
  begin_round();
  return true;
}

asio::awaitable<void> Turns::wait(const void* who) {
  auto begin = [this, who](auto on_turn) {
    waiting_.emplace_back(who, std::move(on_turn));
    begin_round();
  };
  return asio::async_initiate<const asio::use_awaitable_t<>, void()>(std::move(begin), asio::use_awaitable);
}

void Turns::hurry(const void* who) {
  const auto found = std::ranges::find(waiting_, who, &Waiting::who);
  if (found == waiting_.end()) return;
  Waiting first = std::move(*found);
  waiting_.erase(found);
  waiting_.push_front(std::move(first));
}

void Turns::begin_round() {
  if (std::exchange(is_round_, true)) return;
  asio::post(loop_, [this] { next_round(); });
}

void Turns::next_round() {
  is_round_ = false;
  taken_ = 0;
  while (taken_ < at_once_ && !waiting_.empty()) {
    ++taken_;
    auto turn = std::move(waiting_.front().on_turn);
    waiting_.pop_front();
    turn();
  }
  if (!waiting_.empty()) begin_round();
}

}  // namespace server
