// A part of a test that runs as another user of the machine; only root can.
#pragma once

#include <unistd.h>

#include <stdexcept>

namespace server {

inline constexpr uid_t kNobody = 65534;

inline bool may_be_another_user() { return ::geteuid() == 0; }

class AnotherUser {
 public:
  AnotherUser() {
    if (::seteuid(kNobody) != 0) throw std::runtime_error{"cannot be another user"};
  }
  ~AnotherUser() {
    if (::seteuid(0) != 0) std::abort();  // later tests would run as nobody
  }
  AnotherUser(const AnotherUser&) = delete;
  AnotherUser& operator=(const AnotherUser&) = delete;
};

}  // namespace server
