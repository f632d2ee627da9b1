// Rounds: each grants a few turns, and the next begins when the loop has looked at its sockets.
#include "server/runtime/turns.hpp"

#include <boost/asio/async_result.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

namespace server::runtime {
namespace asio = boost::asio;

bool Turns::take() {
  if (taken_ >= at_once_ || !waiting_.empty()) return false;
  ++taken_;
  begin_round();
  return true;
}

asio::awaitable<void> Turns::wait() {
  auto begin = [this](auto on_turn) {
    waiting_.emplace_back(std::move(on_turn));
    begin_round();
  };
  return asio::async_initiate<const asio::use_awaitable_t<>, void()>(std::move(begin), asio::use_awaitable);
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
    auto turn = std::move(waiting_.front());
    waiting_.pop_front();
    turn();
  }
  if (!waiting_.empty()) begin_round();
}

}  // namespace server::runtime
