// A run written to a file by a program of its own, `rheonaut-export`, so that neither the libraries of the formats nor
// their faults are in the station.
//
// The program runs with low priority and no descriptor but its pipe, reads the database through a read-only handle,
// and is killed by end(), when this is destroyed, when the thread that started it ends (with the station, however that
// ends), or when it has not got on for `most_silent`. The file is whole
// when advance() has returned false; before, and after a failure, what stands there is to be removed.
//
// A program that waits for a disk dies when the disk answers, also after SIGKILL. So a station destroys this by
// end_export(), which blocks no thread for longer than a slice; the destructor alone waits for at most 2 s and leaves a
// program that is not dead by then to the end of this one.
//
// On one thread, which advance() and end() block for some milliseconds. Errors of advance(): those of the program
// (export_lines.hpp), with its code and reason; unavailable with the reason `export_program` (it is not there,
// cannot be started, or broke off: the detail says by which signal or status), or `export_stalled`.
#pragma once

#include <sys/types.h>

#include <boost/asio/awaitable.hpp>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "server/runtime/result.hpp"
#include "server/storage/database/database_reader.hpp"
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

  // Kills the program, if it runs, and waits for at most 10 ms; true: nothing of it is left.
  bool end();

 private:
  Result<void> start();
  bool receive();  // false: the program has closed its end
  std::optional<ExportLine> next_line();
  Result<bool> finish(const ExportLine& last);
  std::unexpected<Error> broken_off(const std::string& how) const;
  std::string end_text() const;
  void kill();
  bool is_reaped();

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

// From the loop: ends it on the reader's thread, in slices between other work there, for as long as its death takes.
boost::asio::awaitable<void> end_export(DatabaseReader& reader, std::shared_ptr<ExportChild> child);

}  // namespace server::storage
