// Reads them, and judges.
#include "server/config/resource_limits.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <charconv>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string_view>

namespace server::config {
namespace {

constexpr std::uint64_t kOtherFiles = 200;  // database, logs, exports
constexpr std::uint64_t kMB = 1'000'000;
constexpr std::uint64_t kLeastStack = 1 << 20, kLeastMemory = 4'000 * kMB;

std::optional<std::uint64_t> limit_of(int resource, bool is_hard) {
  rlimit limit{};
  if (::getrlimit(static_cast<__rlimit_resource>(resource), &limit) != 0) return std::nullopt;
  const rlim_t value = is_hard ? limit.rlim_max : limit.rlim_cur;
  return value == RLIM_INFINITY ? std::nullopt : std::optional<std::uint64_t>{value};
}

// "unlimited" is none.
std::optional<std::uint64_t> number_in(const std::string& word) {
  std::uint64_t value = 0;
  const auto read = std::from_chars(word.data(), word.data() + word.size(), value);
  return read.ec == std::errc{} ? std::optional{value} : std::nullopt;
}

}  // namespace

ResourceLimits own_limits() {
  return {limit_of(RLIMIT_FSIZE, false), limit_of(RLIMIT_CPU, true), limit_of(RLIMIT_AS, false),
          limit_of(RLIMIT_STACK, false), limit_of(RLIMIT_NOFILE, true)};
}

ResourceLimits parse_limits(const std::string& text) {
  ResourceLimits limits;
  std::istringstream lines{text};
  for (std::string line; std::getline(lines, line);) {
    const auto take = [&line](std::string_view name, bool is_hard, std::optional<std::uint64_t>& into) {
      if (!line.starts_with(name)) return;
      std::istringstream words{line.substr(name.size())};
      std::string soft, hard;
      words >> soft >> hard;
      into = number_in(is_hard ? hard : soft);
    };
    take("Max file size", false, limits.file_bytes);
    take("Max cpu time", true, limits.cpu_s);
    take("Max address space", false, limits.address_bytes);
    take("Max stack size", false, limits.stack_bytes);
    take("Max open files", true, limits.open_files);
  }
  return limits;
}

std::optional<ResourceLimits> limits_of(int pid) {
  std::ifstream in{fmt::format("/proc/{}/limits", pid)};
  const std::string text{std::istreambuf_iterator<char>{in}, {}};
  if (text.empty()) return std::nullopt;
  return parse_limits(text);
}

std::uint64_t needed_open_files(const Config& config) {
  return config.http_places.connections + config.robot_places.connections + kOtherFiles;
}

std::vector<TightLimit> tight_limits(const ResourceLimits& limits, const Config& config) {
  std::vector<TightLimit> tight;
  if (limits.file_bytes) {
    tight.push_back({fmt::format("a file may grow to {} MB only: at that size the database takes no more samples",
                                 *limits.file_bytes / kMB),
                     "allow more: LimitFSIZE=infinity in the systemd unit, or ulimit -f unlimited"});
  }
  if (limits.cpu_s) {
    tight.push_back({fmt::format("after {} s of computing the system ends the program", *limits.cpu_s),
                     "allow more: LimitCPU=infinity in the systemd unit, or ulimit -t unlimited"});
  }
  if (limits.address_bytes && *limits.address_bytes < kLeastMemory) {
    tight.push_back({fmt::format("{} MB of address space are allowed; a fit or an export may need {}",
                                 *limits.address_bytes / kMB, kLeastMemory / kMB),
                     "allow more: LimitAS=infinity in the systemd unit, or ulimit -v unlimited"});
  }
  if (limits.stack_bytes && *limits.stack_bytes < kLeastStack) {
    tight.push_back(
        {fmt::format("a thread has {} kB of stack, fewer than {}", *limits.stack_bytes / 1024, kLeastStack / 1024),
         "allow more: LimitSTACK=8M in the systemd unit, or ulimit -s 8192"});
  }
  const std::uint64_t needed = needed_open_files(config);
  if (limits.open_files && *limits.open_files < needed) {
    tight.push_back(
        {fmt::format("{} open files are allowed, and {} may be needed: for {} pages and {} robots", *limits.open_files,
                     needed, config.http_places.connections, config.robot_places.connections),
         fmt::format("allow more (LimitNOFILE={} in the systemd unit, or ulimit -Hn), or lower "
                     "robots.max_connections",
                     needed)});
  }
  return tight;
}

}  // namespace server::config
