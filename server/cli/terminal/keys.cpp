// Neither echo nor lines; signals such as Ctrl-C stay.
#include "server/cli/terminal/keys.hpp"

#include <poll.h>
#include <unistd.h>

namespace server::cli {
namespace {

// A program behind the shell that touches its terminal is stopped by the system. Another terminal has no front.
bool is_in_front() {
  const pid_t front = ::tcgetpgrp(STDIN_FILENO);
  return ::isatty(STDIN_FILENO) != 0 && (front < 0 || front == ::getpgrp());
}

}  // namespace

Keys::Keys(bool is_on) : is_on_{is_on && is_in_front() && tcgetattr(STDIN_FILENO, &before_) == 0} {
  if (!is_on_) return;
  termios silent = before_;
  silent.c_lflag &= ~static_cast<tcflag_t>(ECHO | ICANON);
  tcsetattr(STDIN_FILENO, TCSANOW, &silent);
}

Keys::~Keys() {
  if (is_on_ && is_in_front()) tcsetattr(STDIN_FILENO, TCSANOW, &before_);
}

std::optional<char> Keys::pressed() const {
  std::optional<char> last;
  pollfd keys{STDIN_FILENO, POLLIN, 0};
  char key = 0;
  while (is_on_ && is_in_front() && ::poll(&keys, 1, 0) == 1 && ::read(STDIN_FILENO, &key, 1) == 1) last = key;
  return last;
}

}  // namespace server::cli
