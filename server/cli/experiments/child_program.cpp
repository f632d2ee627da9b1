// fork and exec: a tool has one thread.
#include "server/cli/experiments/child_program.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>

namespace server::cli {
namespace {

constexpr int kCannotRun = 127;
constexpr int kMostAtEndMs = 20'000;  // the station writes what it has before it ends

// In the child, before exec: only what is safe there.
[[noreturn]] void become(const char* program, char** arguments, const char* log, pid_t parent) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(kCannotRun);  // it died before it could be watched
  const int output = ::open(log, O_WRONLY | O_CREAT | O_APPEND, 0600);
  const int nothing = ::open("/dev/null", O_RDONLY);
  if (output < 0 || nothing < 0) ::_exit(kCannotRun);
  ::dup2(nothing, STDIN_FILENO);
  ::dup2(output, STDOUT_FILENO);
  ::dup2(output, STDERR_FILENO);
  ::execv(program, arguments);
  ::_exit(kCannotRun);
}

}  // namespace

ChildProgram::ChildProgram(const std::filesystem::path& program, std::vector<std::string> arguments,
                           const std::filesystem::path& log) {
  if (::access(program.c_str(), X_OK) != 0) {
    throw std::runtime_error{fmt::format("cannot run '{}': {}", program.string(), std::strerror(errno))};
  }
  std::string name = program.string();
  std::vector<char*> words{name.data()};
  for (std::string& word : arguments) words.push_back(word.data());
  words.push_back(nullptr);
  const pid_t parent = ::getpid();
  pid_ = ::fork();
  if (pid_ < 0) throw std::runtime_error{fmt::format("cannot start '{}': {}", name, std::strerror(errno))};
  if (pid_ == 0) become(name.c_str(), words.data(), log.c_str(), parent);
}

bool ChildProgram::has_ended() {
  if (pid_ > 0 && ::waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = -1;
  return pid_ < 0;
}

ChildProgram::~ChildProgram() {
  if (has_ended()) return;
  ::kill(pid_, SIGTERM);
  pollfd end{static_cast<int>(::syscall(SYS_pidfd_open, pid_, 0)), POLLIN, 0};
  if (::poll(&end, 1, kMostAtEndMs) != 1) ::kill(pid_, SIGKILL);
  ::close(end.fd);
  ::waitpid(pid_, nullptr, 0);
}

}  // namespace server::cli
