// Signals by which the system says that a limit is reached or that a reader is gone. A program of Rheonaut ignores
// them: the call that met the limit fails, and that is an error like a full disk. By default they end a program without
// a word.
#pragma once

#include <csignal>

namespace base {

inline void ignore_resource_signals() {
  for (const int number : {SIGPIPE, SIGXFSZ, SIGXCPU}) std::signal(number, SIG_IGN);
}

}  // namespace base
