// Keys that a person presses while a tool works, without waiting for a line. The terminal is as before when it ends.
#pragma once

#include <termios.h>

#include <optional>

namespace server::cli {

class Keys {
 public:
  // Keys of standard input, if it is a terminal and this program is in front of it; else none is ever pressed.
  explicit Keys(bool is_on);
  ~Keys();
  Keys(const Keys&) = delete;
  Keys& operator=(const Keys&) = delete;

  bool are_read() const { return is_on_; }
  std::optional<char> pressed() const;  // the last since it was asked; does not wait

 private:
  termios before_{};  // read before it is known whether it is on
  bool is_on_ = false;
};

}  // namespace server::cli
