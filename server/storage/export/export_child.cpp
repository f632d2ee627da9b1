// posix_spawn, a pipe, and SIGKILL at the end.
#include "server/storage/export/export_child.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

namespace server::storage {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr const char* kProgramName = "rheonaut-export";
constexpr auto kSlice = 10ms;
constexpr auto kMostTimeToDie = 2s;  // of a process that was sent SIGKILL
constexpr const char* kWithoutProgram = "samples.csv of the API needs no such program";

// What posix_spawn is given, and frees.
struct SpawnFiles {
  SpawnFiles() { ::posix_spawn_file_actions_init(&actions); }
  ~SpawnFiles() { ::posix_spawn_file_actions_destroy(&actions); }
  SpawnFiles(const SpawnFiles&) = delete;
  SpawnFiles& operator=(const SpawnFiles&) = delete;
  posix_spawn_file_actions_t actions{};
};
struct SpawnAttributes {
  SpawnAttributes() { ::posix_spawnattr_init(&attributes); }
  ~SpawnAttributes() { ::posix_spawnattr_destroy(&attributes); }
  SpawnAttributes(const SpawnAttributes&) = delete;
  SpawnAttributes& operator=(const SpawnAttributes&) = delete;
  posix_spawnattr_t attributes{};
};

// Whatever the station has done to signals and to its scheduling, the child begins as usual.
void as_usual(posix_spawnattr_t& attributes) {
  sigset_t none{}, all{};
  ::sigemptyset(&none);
  ::sigfillset(&all);
  const sched_param usual{};
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setsigdefault(&attributes, &all);
  ::posix_spawnattr_setschedpolicy(&attributes, SCHED_OTHER);
  ::posix_spawnattr_setschedparam(&attributes, &usual);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSCHEDULER);
}

// Returns an errno. The child has no input, `output` as its output, the errors of this program, and nothing else.
int spawn(const fs::path& program, const std::vector<std::string>& words, int output, pid_t& pid) {
  SpawnFiles files;
  ::posix_spawn_file_actions_addopen(&files.actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_adddup2(&files.actions, output, STDOUT_FILENO);
  ::posix_spawn_file_actions_addclosefrom_np(&files.actions, STDERR_FILENO + 1);
  SpawnAttributes usual;
  as_usual(usual.attributes);
  std::string name = kProgramName;
  std::vector<std::string> kept = words;
  std::vector<char*> arguments{name.data()};
  for (std::string& word : kept) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  return ::posix_spawn(&pid, program.c_str(), &files.actions, &usual.attributes, arguments.data(), environ);
}

bool is_program(const fs::path& path) { return ::access(path.c_str(), X_OK) == 0 && !fs::is_directory(path); }

}  // namespace

Result<fs::path> find_export_program() {
  const fs::path folder = fs::read_symlink("/proc/self/exe").parent_path();
  const fs::path beside = folder / kProgramName;
  if (is_program(beside)) return beside;
  const fs::path installed = folder.parent_path() / "libexec" / "rheonaut" / kProgramName;
  if (is_program(installed)) return installed;
  return fail(ErrorCode::unavailable,
              fmt::format("the program that writes export files is neither {} nor {}; install Rheonaut again, or build "
                          "its target {}; {}",
                          beside.string(), installed.string(), kProgramName, kWithoutProgram),
              "export_program");
}

ExportChild::ExportChild(ExportOrder order, ExportLimits limits)
    : order_{std::move(order)}, limits_{std::move(limits)} {}

ExportChild::~ExportChild() {
  for (const auto end_at = std::chrono::steady_clock::now() + kMostTimeToDie; !end();) {
    if (std::chrono::steady_clock::now() >= end_at) return;
  }
}

Result<bool> ExportChild::advance() {
  if (pid_ < 0) {
    if (auto started = start(); !started) return std::unexpected{started.error()};
  }
  const bool is_open = receive();
  while (const auto line = next_line()) {
    last_line_ = std::chrono::steady_clock::now();
    const auto* progress = std::get_if<ExportProgress>(&*line);
    if (progress == nullptr) return finish(*line);
    progress_ = *progress;
  }
  if (is_garbled_ || received_.size() > kMaxLineBytes) return broken_off("wrote what is no line of its protocol");
  if (!is_open) return broken_off(end_text());
  const auto silent = std::chrono::steady_clock::now() - last_line_;
  if (silent < limits_.most_silent) return true;
  kill();
  return fail(
      ErrorCode::unavailable,
      fmt::format("the export of run {} made no progress for {:.3g} s and was ended; is the station's disk "
                  "busy or gone? {}",
                  order_.query.run, std::chrono::duration<double>{limits_.most_silent}.count(), kWithoutProgram),
      "export_stalled");
}

Result<void> ExportChild::start() {
  auto program = limits_.program ? Result<fs::path>{*limits_.program} : find_export_program();
  if (!program) return std::unexpected{program.error()};
  program_ = std::move(*program);
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) {
    throw std::system_error{errno, std::generic_category(), "cannot make the pipe of an export"};
  }
  pipe_ = ends[0];
  ::fcntl(pipe_, F_SETFL, O_NONBLOCK);
  pid_t pid = -1;
  const int error = spawn(program_, export_arguments(order_, ::getpid()), ends[1], pid);
  ::close(ends[1]);
  if (error != 0) return broken_off(fmt::format("cannot be started: {}", std::strerror(error)));
  pid_ = pid;
  last_line_ = std::chrono::steady_clock::now();
  return {};
}

bool ExportChild::receive() {
  pollfd waiting{pipe_, POLLIN, 0};
  ::poll(&waiting, 1, static_cast<int>(kSlice.count()));
  char bytes[4096];
  const ssize_t size = ::read(pipe_, bytes, sizeof bytes);
  if (size > 0) received_.append(bytes, static_cast<std::size_t>(size));
  return size > 0 || (size < 0 && (errno == EAGAIN || errno == EINTR));
}

// Whole lines only.
std::optional<ExportLine> ExportChild::next_line() {
  const std::size_t end = received_.find('\n');
  if (end == std::string::npos) return std::nullopt;
  auto line = parse_export_line(std::string_view{received_}.substr(0, end));
  received_.erase(0, end + 1);
  if (!line) is_garbled_ = true;
  return line;
}

Result<bool> ExportChild::finish(const ExportLine& last) {
  kill();
  if (const auto* error = std::get_if<Error>(&last)) return std::unexpected{*error};
  progress_.passed = progress_.total;
  return false;
}

std::unexpected<Error> ExportChild::broken_off(const std::string& how) const {
  return fail(ErrorCode::unavailable,
              fmt::format("the program that writes export files ({}) {}; there is no file; {}", program_.string(), how,
                          kWithoutProgram),
              "export_program");
}

// It has closed its output, so it ends by itself, or it is ended.
std::string ExportChild::end_text() const {
  int status = 0;
  for (const auto end = std::chrono::steady_clock::now() + kMostTimeToDie; std::chrono::steady_clock::now() < end;) {
    siginfo_t found{};
    if (::waitid(P_PID, static_cast<id_t>(pid_), &found, WEXITED | WNOHANG | WNOWAIT) == 0 && found.si_pid == pid_) {
      status = found.si_status;
      if (found.si_code == CLD_EXITED) return fmt::format("ended with status {} before the file was whole", status);
      return fmt::format("was ended by signal {} ({}) before the file was whole", status, ::strsignal(status));
    }
    ::poll(nullptr, 0, 1);
  }
  return "closed its output before the file was whole";
}

void ExportChild::kill() {
  if (pipe_ >= 0) ::close(pipe_);
  pipe_ = -1;
  if (pid_ >= 0) ::kill(pid_, SIGKILL);
}

bool ExportChild::is_reaped() {
  if (pid_ < 0) return true;
  if (::waitpid(pid_, nullptr, WNOHANG) == 0) return false;
  pid_ = -1;  // it was reaped, or is no child any more
  return true;
}

// SAFETY: nothing of a child is left behind: not the process, not its entry, not the pipe.
bool ExportChild::end() {
  kill();
  for (const auto end_at = std::chrono::steady_clock::now() + kSlice; !is_reaped();) {
    if (std::chrono::steady_clock::now() >= end_at) return false;
    ::poll(nullptr, 0, 1);
  }
  return true;
}

boost::asio::awaitable<void> end_export(DatabaseReader& reader, std::shared_ptr<ExportChild> child) {
  for (bool is_gone = false; !is_gone;) {
    auto slice = [child] { return child->end(); };
    is_gone = co_await reader.run(std::move(slice));
  }
}

}  // namespace server::storage
