// A program that this one starts, and that does not outlive it.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace server::cli {

class ChildProgram {
 public:
  // Starts it with its output in `log`. It gets no signal of the terminal, and SIGTERM when this program dies. Throws
  // std::runtime_error that names it.
  ChildProgram(const std::filesystem::path& program, std::vector<std::string> arguments,
               const std::filesystem::path& log);
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;
  // SIGTERM, and SIGKILL when it is still there after 20 s.
  ~ChildProgram();

  bool has_ended();
  pid_t pid() const { return pid_; }  // -1: it has ended

 private:
  pid_t pid_ = -1;
};

}  // namespace server::cli
