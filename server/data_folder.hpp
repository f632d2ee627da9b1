// The folder of everything one station keeps: made when missing, locked against a second station, announced when ready.
//
//   station.sqlite                   written by the recorder
//   rheonaut.token, .sessions        written by the API
//   endpoints.json                   {"http":"127.0.0.1:8080","robots":"127.0.0.1:7070","pid":123}, while it runs
//   rheonaut.lock                    locked while it runs
#pragma once

#include <filesystem>
#include <string>

namespace server {

class DataFolder {
 public:
  // Also takes from everyone else the rights on whatever the program makes from now on (umask).
  // Throws std::runtime_error that names the folder: it cannot be made, or another station runs in it.
  explicit DataFolder(std::filesystem::path path);
  ~DataFolder();  // removes endpoints.json
  DataFolder(const DataFolder&) = delete;
  DataFolder& operator=(const DataFolder&) = delete;

  // Writes endpoints.json, whole or not at all.
  void announce(const std::string& http, const std::string& robots);

 private:
  std::filesystem::path endpoints() const { return path_ / "endpoints.json"; }

  std::filesystem::path path_;
  int lock_ = -1;
};

}  // namespace server
