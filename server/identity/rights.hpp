// The list of what acts in somebody's name after they asked for it: all of it ends when their right ends.
//
//   a token that is revoked or has expired, a user who is disabled, removed or may do less, a password or a session
//   that another takes away → Accounts → Rights::end() → each part that was added
//
// Accounts also looks each second at all who act: for a right that ended while the station was down, or in the middle
// of something. Open connections end by their Standing. Who signs out, whose session runs out, or who changes their own
// password, is only away: what they left goes on as if they were silent.
// SAFETY: a stop, one that is kept, and what brings a robot to rest are in nobody's name, and end with no right.
// Loop thread.
#pragma once

#include <spdlog/spdlog.h>

#include <exception>
#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/identity/account.hpp"
#include "server/runtime/ended_right.hpp"
#include "server/runtime/exceptions.hpp"

namespace server::identity {

class Rights {
 public:
  struct Part {
    std::string what;  // for the log
    Scope needs;       // of who acts so
    std::function<std::set<std::string>()> acting;
    std::function<void(const runtime::EndedRight&)> end;
  };

  void add(Part part) { parts_.push_back(std::move(part)); }
  const std::vector<Part>& parts() const { return parts_; }

  // `left`: what its owner may still do.
  void end(const runtime::EndedRight& right, Scopes left) const {
    for (const Part& part : parts_) {
      if (!left.allow(part.needs)) end(part, right);
    }
  }
  // SAFETY: a part that fails keeps no other one from its end.
  static void end(const Part& part, const runtime::EndedRight& right) {
    try {
      part.end(right);
    } catch (const std::exception& error) {
      spdlog::error("the end of {}, since {}: {}", part.what, right.why, runtime::text_of(error));
    }
  }

 private:
  std::vector<Part> parts_;  // in the order in which they end
};

}  // namespace server::identity
