// The caller of a request or an open page: its rights, and whether they still hold.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "server/identity/account.hpp"
#include "server/runtime/clock.hpp"

namespace server::identity {

// Whether a credential still holds, shared by its users: ends when it is revoked or expires, or its role changes.
// Loop thread.
class Standing {
 public:
  explicit Standing(boost::asio::io_context& loop) : changed_{loop} {}

  void end() {
    ended_ = true;
    changed_.notify();
  }
  bool ended() const { return ended_; }
  boost::asio::awaitable<void> wait_for_end() {
    while (!ended_) co_await changed_.wait();
  }

 private:
  bool ended_ = false;
  runtime::Signal changed_;
};

struct Caller {
  std::string actor;          // "token:local", "token:ci", "session:3", "user:anna/session:4"; empty: nobody said
  std::string user;           // empty: by the station's own token, or a one-time link
  Scopes scopes;              // what it may do
  std::uint64_t session = 0;  // of a page; 0: a token
  std::shared_ptr<Standing> standing;  // null: nobody
  std::string peer;                    // the address that the connection comes from
  std::string client{};                // the tab, or the invocation of a tool, by its own id; empty: it gave none

  Role role() const { return scopes.role(); }
};

// Whether a client may call itself so: 8 to 64 letters, digits, "-" and "_".
inline bool is_client_id(std::string_view text) {
  const auto may_be = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  };
  return text.size() >= 8 && text.size() <= 64 && std::ranges::all_of(text, may_be);
}

}  // namespace server::identity
