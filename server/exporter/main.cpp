// Writes one run into one file for the program that started it, and ends with that program.
#include <sqlite3.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <string_view>

#include "base/resource_signals.hpp"
#include "base/version.hpp"
#include "server/exporter/export_work.hpp"
#include "server/runtime/exceptions.hpp"

using namespace server;  // NOLINT: this file is the program, seen from outside

static void tell(const storage::ExportLine& line) {
  const std::string text = storage::line_text(line);
  if (::write(STDOUT_FILENO, text.data(), text.size()) < 0) ::_exit(EXIT_FAILURE);  // nobody waits for the file
}

// The recording goes first: its threads, its disk, and its memory: where that ends, this program is ended and no other.
static void be_modest() {
  constexpr int kNiceness = 10, kOfThisProcess = 1, kIdleClass = 3, kClassShift = 13;
  ::setpriority(PRIO_PROCESS, 0, kNiceness);
  ::syscall(SYS_ioprio_set, kOfThisProcess, 0, kIdleClass << kClassShift);
  if (std::FILE* score = std::fopen("/proc/self/oom_score_adj", "we")) {
    std::fputs("1000", score);
    std::fclose(score);
  }
}

// It has one thread, and nobody asks how much memory SQLite has: so there are neither locks nor counts.
static void configure_sqlite() {
  ::sqlite3_config(SQLITE_CONFIG_SINGLETHREAD);
  ::sqlite3_config(SQLITE_CONFIG_MEMSTATUS, 0);
}

int main(int argc, char** argv) try {
  if (argc == 2 && std::string_view{argv[1]} == "--version") return std::puts(base::version()) < 0 ? 1 : 0;
  configure_sqlite();
  base::ignore_resource_signals();
  const auto received = storage::parse_export_arguments({argv + 1, argv + argc});
  if (!received) {
    tell(received.error());
    return EXIT_FAILURE;
  }
  // SAFETY: it ends with the program that started it, also when that has ended before this line.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != received->parent) return EXIT_FAILURE;
  be_modest();
  const auto written = exporter::write_export(received->order, tell);
  written ? tell(storage::ExportDone{}) : tell(written.error());
  return written ? EXIT_SUCCESS : EXIT_FAILURE;
} catch (const std::exception& error) {
  tell(Error{ErrorCode::unavailable, runtime::text_of(error), "export_failed"});
  return EXIT_FAILURE;
}
