// The data folder of a station: created when missing, locked against a second station, announced when ready.
//
//   station.sqlite                   written by the recorder
//   station.head.json                the database's state some seconds ago (storage/upkeep/store_head)
//   rheonaut.token, .sessions        written by the API
//   endpoints.json                   {"http":"127.0.0.1:8080","robots":"127.0.0.1:7070","pid":123}, while it runs; and
//                                    "tls_certificate", the file to trust, when http is https, and
//                                    "robots_tls_certificate" when robots dial with TLS
//   tls/                             made by `rheonaut certificate`
//   rheonaut.lock                    locked while it runs, or a command works on the files; says which one
//   rheonaut.reserve                 1 MB of room for a start on a full disk
#pragma once

#include <boost/asio/awaitable.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "server/runtime/clock.hpp"

namespace server::config {

// The lock on a data folder: only the program that holds it writes there.
class FolderLock {
 public:
  // None when another program holds it. The folder is there. Throws std::runtime_error when it cannot be asked.
  // Its command line, as "rheonaut backup", and its process id are then in the file.
  static std::optional<FolderLock> try_take(const std::filesystem::path& folder);
  // "rheonaut backup (pid 123)", which holds it; "another program" where the file does not say.
  static std::string holder(const std::filesystem::path& folder);
  FolderLock(FolderLock&& other) noexcept : file_{std::exchange(other.file_, -1)} {}
  FolderLock& operator=(FolderLock&&) = delete;
  ~FolderLock();

 private:
  explicit FolderLock(int file) : file_{file} {}
  int file_ = -1;
};

// Where the running station is, for other programs of its user.
struct Announcement {
  std::string http;                    // "127.0.0.1:8080"
  std::string robots;                  // "127.0.0.1:7070"
  std::string tls_certificate;         // of http; empty: it is plain
  std::string robots_tls_certificate;  // the same of robots
};

class DataFolder {
 public:
  // Makes it (make_data_folder), and throws std::runtime_error that names it also when another station runs in it.
  explicit DataFolder(std::filesystem::path path);
  ~DataFolder();  // removes endpoints.json
  DataFolder(const DataFolder&) = delete;
  DataFolder& operator=(const DataFolder&) = delete;

  // Writes endpoints.json, whole or not at all. SAFETY: a full disk keeps no robot from being stopped: it is tried
  // again until it is there.
  boost::asio::awaitable<void> announce(runtime::Clock& clock, Announcement announcement);

 private:
  bool write_endpoints(const std::string& content) const;
  std::filesystem::path endpoints() const { return path_ / "endpoints.json"; }

  std::filesystem::path path_;
  FolderLock lock_;
};

// Takes from everyone else the rights on whatever the program makes from now on, and makes the folder when it is
// missing. Throws std::runtime_error that names it, also when it is not ours (runtime::require_own_folder).
void make_data_folder(const std::filesystem::path& path);

}  // namespace server::config
