// Measures, then judges.
#include "server/cli/health/machine_checks.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/io_context.hpp>
#include <cmath>

#include "server/config/file_system.hpp"
#include "server/runtime/tasks.hpp"
#include "server/storage/upkeep/disk_watch.hpp"

namespace server::cli {
namespace {

constexpr double kSlowSyncMs = 100, kTooSlowSyncMs = 1000;  // a commit each 100 ms; robots keep some 8 s of samples
constexpr double kMostStepMs = 20;
constexpr microseconds kClockWatch{std::chrono::milliseconds{250}};
constexpr std::int64_t kMostFutureUs = 60'000'000;
constexpr double kUsPerS = 1e6;

double elapsed_ms(std::int64_t from_us, std::int64_t to_us) { return static_cast<double>(to_us - from_us) / 1e3; }

std::optional<double> measure_sync_ms(const std::filesystem::path& folder) {
  std::string name = (folder / ".doctor-XXXXXX").string();
  const int file = ::mkstemp(name.data());
  if (file < 0) return std::nullopt;
  ::unlink(name.c_str());
  boost::asio::io_context loop;
  const runtime::SystemClock clock{loop};
  const std::array<char, 4096> page{};
  std::array<double, 5> times{};
  for (double& time : times) {
    const std::int64_t begun_us = clock.steady_us();
    const bool is_written = ::pwrite(file, page.data(), page.size(), 0) == std::ssize(page) && ::fdatasync(file) == 0;
    if (!is_written) {
      ::close(file);
      return std::nullopt;
    }
    time = elapsed_ms(begun_us, clock.steady_us());
  }
  ::close(file);
  std::ranges::sort(times);
  return times[times.size() / 2];
}

}  // namespace

DiskFacts measure_disk(const std::filesystem::path& data_dir) {
  return {storage::free_bytes_of(data_dir), measure_sync_ms(data_dir)};
}

void judge_disk(const DiskFacts& facts, const config::Config& config, Findings& findings) {
  const storage::SpaceLimits limits = storage::space_limits(config.recording);
  const storage::SpaceState state = next_state(storage::SpaceState::ok, facts.free_bytes, limits);
  const std::string free =
      fmt::format("{} MB are free on the disk of {}", facts.free_bytes / 1'000'000, config.data_dir.string());
  constexpr const char* kMakeRoom = "make room on the disk, or set recording.retention_days";
  if (state == storage::SpaceState::ok) {
    findings.fine("space", free);
  } else if (state == storage::SpaceState::low) {
    findings.problem("space", fmt::format("{}, fewer than low_space_mb = {}", free, config.recording.low_space_mb),
                     kMakeRoom);
  } else {
    findings.problem("space",
                     fmt::format("{}, fewer than critical_space_mb = {}: no run and no backup can be begun", free,
                                 config.recording.critical_space_mb),
                     kMakeRoom);
  }
  if (!facts.sync_ms) {
    return findings.problem("disk", fmt::format("no file can be written into {}", config.data_dir.string()),
                            "run rheonaut doctor as the user that runs the station; else the disk is full, broken, or "
                            "mounted read-only");
  }
  const std::string sync = fmt::format("4 kB are durable after {:.1f} ms", *facts.sync_ms);
  if (*facts.sync_ms < kSlowSyncMs) return findings.fine("disk", sync);
  constexpr const char* kFaster =
      "put the data folder on a faster disk (not a network folder or a slow card), and look "
      "for other programs that write much";
  if (*facts.sync_ms < kTooSlowSyncMs) return findings.note("disk", sync + ", which is slow", kFaster);
  findings.problem("disk", sync + ": a robot that loses its link meanwhile may lose samples", kFaster);
}

ClockFacts measure_clock() {
  ClockFacts facts;
  timex state{};
  const int answer = adjtimex(&state);
  if (answer >= 0) facts.is_synchronised = (state.status & STA_UNSYNC) == 0 && answer != TIME_ERROR;
  boost::asio::io_context loop;
  runtime::SystemClock clock{loop};
  const std::int64_t utc_begun_us = clock.utc_us(), steady_begun_us = clock.steady_us();
  runtime::run_first(loop, clock.sleep_for(kClockWatch));
  facts.now_us = clock.utc_us();
  facts.step_ms = elapsed_ms(utc_begun_us, facts.now_us) - elapsed_ms(steady_begun_us, clock.steady_us());
  return facts;
}

void judge_clock(const ClockFacts& facts, Findings& findings) {
  constexpr const char* kSynchronise = "synchronise the clock (apt install chrony, or timedatectl set-ntp true)";
  const std::int64_t behind_us = facts.recorded_us - facts.now_us;
  if (facts.recorded_us != 0 && behind_us > kMostFutureUs) {
    findings.problem("clock",
                     fmt::format("the clock is {:.0f} s behind what was recorded last: it is wrong now, or was wrong "
                                 "then",
                                 static_cast<double>(behind_us) / kUsPerS),
                     "set the clock before the station starts; retention may keep what was recorded in the future");
  }
  if (std::abs(facts.step_ms) > kMostStepMs) {
    return findings.problem("clock",
                            fmt::format("the clock jumped by {:.0f} ms while it was watched for 250 ms", facts.step_ms),
                            "find out which program sets the clock; two time services may work against each other");
  }
  if (!facts.is_synchronised) {
    return findings.note("clock", "the clock runs steadily; the system does not say whether it is synchronised",
                         kSynchronise);
  }
  if (*facts.is_synchronised) return findings.fine("clock", "it is synchronised and runs steadily");
  findings.note("clock",
                "the clock runs steadily, but is not synchronised: recorded times may differ from those of "
                "other machines",
                kSynchronise);
}

void check_real_time(const RunningStation& running, const config::Config& config, Findings& findings) {
  if (!config.real_time) return findings.fine("real time", "it is not asked for (station.real_time = false)");
  constexpr const char* kPermit =
      "permit it: LimitRTPRIO=2 in the systemd unit, or a line '@USER - rtprio 2' in "
      "/etc/security/limits.conf; without it a busy machine may delay a stop";
  if (running.is_running && running.pid > 0) {
    // The mark that the station leaves where it was permitted, also while the loop is ordinary.
    const bool is_permitted = (sched_getscheduler(running.pid) & SCHED_RESET_ON_FORK) != 0;
    if (is_permitted) return findings.fine("real time", "the station's loop has real-time priority on a busy machine");
    return findings.note("real time", "the station's loop runs without real-time priority", kPermit);
  }
  rlimit limit{};
  getrlimit(RLIMIT_RTPRIO, &limit);
  if (limit.rlim_cur >= 2) return findings.fine("real time", "this user may ask for real-time priority");
  if (geteuid() == 0) return findings.fine("real time", "root may ask for real-time priority");
  findings.note("real time", "this user may not ask for real-time priority", kPermit);
}

void check_limits(const RunningStation& running, const config::Config& config, Findings& findings) {
  std::optional<config::ResourceLimits> limits;
  if (running.is_running && running.pid > 0) limits = config::limits_of(running.pid);
  judge_limits(limits.value_or(config::own_limits()), config, findings);
}

void judge_limits(const config::ResourceLimits& limits, const config::Config& config, Findings& findings) {
  const auto tight = tight_limits(limits, config);
  for (const config::TightLimit& limit : tight) findings.problem("limits", limit.what, limit.action);
  if (!tight.empty()) return;
  findings.fine("limits",
                fmt::format("files, memory and computing are not limited; {} open files are allowed, {} may be "
                            "needed",
                            limits.open_files ? fmt::format("{}", *limits.open_files) : "any number of",
                            needed_open_files(config)));
}

void judge_file_system(const std::string& unsuitable, const config::Config& config, Findings& findings) {
  if (unsuitable.empty()) return findings.fine("file system", "locks, links and syncs hold there, as far as is known");
  findings.problem("file system", config::unsuitable_in_words(unsuitable, config.data_dir),
                   "stop the station, copy the folder to a local disk, and name it with --data");
}

}  // namespace server::cli
