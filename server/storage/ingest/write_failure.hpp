// Whether the last commit failed: why, when it is tried again, and what the log says of it meanwhile.
//
// Plain bookkeeping; times are the caller's, steady.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace server::storage {

class WriteFailure {
 public:
  bool is_failing() const { return retry_at_us_ != 0; }
  std::int64_t retry_at_us() const { return retry_at_us_; }
  const std::string& problem() const { return problem_; }  // while it is failing: why, and what to do

  // A commit into this file failed. Logged each 10 s while it lasts.
  void on_failed(const std::string& problem, const std::filesystem::path& path, std::int64_t now_us);
  // A commit is durable.
  void on_written();

 private:
  std::int64_t retry_at_us_ = 0;  // 0 unless the last commit failed
  std::int64_t logged_us_ = 0;
  std::string problem_;
};

}  // namespace server::storage
