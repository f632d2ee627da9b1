// What a command does while a person waits for it: one line on standard error, rewritten four times a second, e.g.
// "export: 42 %, 3 s". It appears when the command has taken a second, and is gone when this is destroyed.
//
// Nothing is written where standard error is no terminal, or where the answer is JSON, for that is read by programs.
// Computations of the libraries do not return while they work, so a thread of its own writes the line.
#pragma once

#include <memory>
#include <string>

#include "server/cli/terminal/output.hpp"

namespace server::cli {

class Progress {
 public:
  Progress(std::string what, const OutputForm& form);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void set_share(double share);         // from 0 to 1; without it the line has no percent
  void set_detail(std::string detail);  // in words, instead of the share

 private:
  struct Line;
  std::unique_ptr<Line> line_;  // none: nobody watches
};

}  // namespace server::cli
