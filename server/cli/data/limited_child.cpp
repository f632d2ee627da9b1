// fork and setrlimit. A limit that the user has set and that is lower stays.
#include "server/cli/data/limited_child.hpp"

#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <new>
#include <stdexcept>
#include <string>

#include "server/storage/database/finished_file.hpp"

namespace server::cli {
namespace {

constexpr rlim_t kMegabyte = 1'000'000, kDescriptors = 64;

struct Limits {
  rlim_t memory_bytes, file_bytes, time_s;
};

// The archive of the longest run, 2,000,000 samples, has 31 MB or more, and needs 2.2 GB and 15 s with sanitizers.
Limits limits_for(const std::filesystem::path& file) {
  std::error_code absent;
  const auto size = std::filesystem::file_size(file, absent);
  const rlim_t bytes = absent ? 0 : size;
  return {2000 * kMegabyte + 40 * bytes, 1000 * kMegabyte + 4 * bytes, 600 + 2 * bytes / kMegabyte};
}

using Resource = decltype(RLIMIT_AS);

rlimit lowered(Resource resource, rlim_t most) {
  rlimit both{};
  ::getrlimit(resource, &both);
  // At the soft limit of processor time comes SIGXCPU, at the hard one SIGKILL.
  return {std::min(both.rlim_cur, most), std::min(both.rlim_max, most + 1)};
}

void limit(Resource resource, rlim_t most) {
  const rlimit both = lowered(resource, most);
  ::setrlimit(resource, &both);
}

// The address space that the program itself has already taken; with a sanitizer that is terabytes.
rlim_t address_space_bytes() {
  rlim_t pages = 0;
  std::ifstream{"/proc/self/statm"} >> pages;
  return pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

std::array<std::string, storage::kDraftSuffixes.size()> draft_names;  // in the child, for the handler below

void remove_and_end(int number) {
  for (const std::string& name : draft_names) ::unlink(name.c_str());
  std::signal(number, SIG_DFL);
  std::raise(number);
}

void become_limited(const ForeignFile& foreign, const Limits& limits, pid_t parent) {
  for (std::size_t i = 0; !foreign.draft.empty() && i < draft_names.size(); ++i) {
    draft_names.at(i) = foreign.draft.string() + storage::kDraftSuffixes.at(i);
  }
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) {
    if (std::signal(number, remove_and_end) == SIG_IGN) std::signal(number, SIG_IGN);
  }
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(EXIT_FAILURE);
  for (const int number : {SIGXCPU, SIGXFSZ}) std::signal(number, SIG_DFL);
  std::set_new_handler([] { std::abort(); });
  std::ofstream{"/proc/self/oom_score_adj"} << 1000;
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_NOFILE, kDescriptors);
  limit(RLIMIT_CPU, limits.time_s);
  if (!foreign.draft.empty()) limit(RLIMIT_FSIZE, limits.file_bytes);  // the station's own database may be longer
  limit(RLIMIT_AS, address_space_bytes() + limits.memory_bytes);
}

std::string cause_of(int number, const Limits& limits) {
  constexpr const char* kTooMuch =
      "no file of its size that Rheonaut wrote needs as much; get it again from its source";
  const rlim_t time_s = lowered(RLIMIT_CPU, limits.time_s).rlim_cur;
  const rlim_t file_bytes = lowered(RLIMIT_FSIZE, limits.file_bytes).rlim_cur;
  switch (number) {
    case SIGXCPU: return fmt::format("it took more than {} s of processor time; {}", time_s, kTooMuch);
    case SIGXFSZ: return fmt::format("a file made of it had more than {} bytes; {}", file_bytes, kTooMuch);
    case SIGABRT:
      return fmt::format("it needed more than {} MB of memory; {}", limits.memory_bytes / kMegabyte, kTooMuch);
    default: return fmt::format("its process got signal {} ({})", number, ::strsignal(number));
  }
}

}  // namespace

std::optional<int> read_in_child(const ForeignFile& foreign) {
  const Limits limits = limits_for(foreign.file);
  const pid_t parent = ::getpid(), child = ::fork();
  if (child < 0) throw std::runtime_error{fmt::format("cannot start a process: {}", std::strerror(errno))};
  if (child == 0) {
    become_limited(foreign, limits, parent);
    return std::nullopt;
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
  if (WIFEXITED(status)) return WEXITSTATUS(status);
  if (!foreign.draft.empty()) storage::remove_draft(foreign.draft);
  throw std::runtime_error{
      fmt::format("'{}' was not read to its end: {}", foreign.file.string(), cause_of(WTERMSIG(status), limits))};
}

}  // namespace server::cli
