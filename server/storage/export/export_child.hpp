// A run written to a file by a program of its own, `rheonaut-export`, so that neither the libraries of the formats nor
// their faults are in the station.
//
// The program runs with low priority and no descriptor but its pipe, reads the database through a read-only handle,
// and is killed when this is destroyed, when the thread that started it ends (with the station, however that ends), or
// when it has not got on for `most_silent`. The file is whole
// when advance() has returned false; before, and after a failure, what stands there is to be removed.
//
// On one thread, which advance() blocks for some milliseconds. Errors of advance(): those of the program
// (export_lines.hpp), with its code and reason; unavailable with the reason `export_program` (it is not there,
// cannot be started, or broke off: the detail says by which signal or status), or `export_stalled`.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "server/runtime/result.hpp"
#include "server/storage/export/export_lines.hpp"
#include "server/storage/export/export_order.hpp"

namespace server::storage {

// Where the program is: beside this one, else in ../libexec/rheonaut/ of this one's folder. unavailable: in neither.
Result<std::filesystem::path> find_export_program();

struct ExportLimits {
  std::optional<std::filesystem::path> program;  // none: find_export_program()
  std::chrono::milliseconds most_silent{60'000};
};

class ExportChild {
 public:
  explicit ExportChild(ExportOrder order, ExportLimits limits = {});
  ~ExportChild();
  ExportChild(const ExportChild&) = delete;
  ExportChild& operator=(const ExportChild&) = delete;

  // Starts the program at the first call. Waits for at most 10 ms; false: the file is whole.
  Result<bool> advance();

  const ExportProgress& progress() const { return progress_; }

 private:
  Result<void> start();
  bool receive();  // false: the program has closed its end
  std::optional<ExportLine> next_line();
  Result<bool> finish(const ExportLine& last);
  std::unexpected<Error> broken_off(const std::string& how) const;
  std::string end_text() const;
  void kill_and_reap();

  ExportOrder order_;
  ExportLimits limits_;
  ExportProgress progress_;
  std::filesystem::path program_;
  pid_t pid_ = -1;
  int pipe_ = -1;
  std::string received_;
  bool is_garbled_ = false;
  std::chrono::steady_clock::time_point last_line_;
};

}  // namespace server::storage
