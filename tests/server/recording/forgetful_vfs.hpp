// SQLite's view of the disk while the power may fail: everything passes through to the system's VFS, a ForgetfulDisk
// remembers what was synced, and at a chosen call the power fails.
//
//   ForgetfulVfs vfs;                     // SQLite's default VFS from here on; no connection is open
//   vfs.begin(Survival::torn, 40);        // of the calls that change something, the 40th is the last
//   ... use SQLite until vfs.has_failed(), close every connection ...
//   vfs.lose_power(random);               // the files are as the disk could hold them; begin() again
//
// Counted are write, sync, truncation and removal of a database, journal or log, and the barrier between two steps of
// the shared index. The failing call has its effect, but says SQLITE_IOERR like every later one. Real syncs are left
// out: the machine's own power stays on. It reports to SQLite that writes are safe for their neighbours except where
// Survival is torn. Any thread.
#pragma once

#include <sqlite3.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>

#include "tests/server/recording/forgetful_disk.hpp"

namespace server {

class ForgetfulVfs {
 public:
  ForgetfulVfs();
  ~ForgetfulVfs();
  ForgetfulVfs(const ForgetfulVfs&) = delete;
  ForgetfulVfs& operator=(const ForgetfulVfs&) = delete;

  // `last_call` 0: the power does not fail.
  void begin(Survival survival, std::uint64_t last_call, bool count_barriers = true);
  bool has_failed() const;
  std::string failed_call() const;  // such as "sync of the log"; empty unless has_failed()

  // The next writes say SQLITE_FULL and have no effect.
  void refuse_writes(unsigned count);

  // A writer to the database, not to its log, blocks until let_go().
  void hold_database_writes();
  bool await_held_write(std::chrono::seconds limit) const;  // until somebody does
  void let_go();

  // After has_failed(), every connection closed. Without it, as after a `kill -9`, the files hold everything that was
  // written, but what was not synced is not durable yet.
  void lose_power(std::mt19937& random);

 private:
  struct Shim;  // the functions that SQLite calls
  struct OpenFile;

  bool count_call(const char* name, std::string_view path);  // true: it was the last
  void stand_still_if_held(const OpenFile& file);

  mutable std::mutex mutex_;
  ForgetfulDisk disk_;
  Survival survival_ = Survival::nothing;
  std::uint64_t calls_ = 0;
  std::uint64_t last_call_ = 0;
  bool count_barriers_ = true;
  unsigned refused_writes_ = 0;
  bool holds_database_writes_ = false;
  bool holds_one_ = false;
  mutable std::condition_variable hold_changed_;
  bool has_failed_ = false;
  std::string failed_call_;

  sqlite3_vfs* real_ = nullptr;
  std::unique_ptr<sqlite3_vfs> vfs_;
};

}  // namespace server
