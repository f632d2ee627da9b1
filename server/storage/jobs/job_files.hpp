// Files that jobs have made, kept for a while in a folder beside the database: reports and exports.
//
//   name = "job-" job-id "-" seconds of UTC when it was finished "." ending          a draft has ".part" after that
//
// The newest kMaxJobFiles are kept, together at most kMaxJobFileBytes, for at most kJobFileAge. A file appears whole or
// not at all: a job writes a draft, and what it leaves of it is removed with the next file or start. Of a job that is
// not done a start removes the file too.
// Loop thread; the work is done on the reader's thread. Clock and reader outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/database/removal_clock.hpp"
#include "server/storage/jobs/job.hpp"

namespace server::storage {

inline constexpr std::size_t kMaxJobFiles = 50;
inline constexpr std::uint64_t kMaxJobFileBytes = 2'000'000'000;
inline constexpr std::chrono::seconds kJobFileAge = std::chrono::days{7};

struct JobFile {
  JobId job = 0;
  std::int64_t finished_at_s = 0;  // UTC
  std::string ending;              // "html"
  std::filesystem::path path;
  std::uint64_t size_bytes = 0;

  std::int64_t kept_until_us() const { return 1'000'000 * (finished_at_s + kJobFileAge.count()); }
};

// Which of these are kept, newest first.
std::vector<JobFile> files_to_keep(std::vector<JobFile> files, std::int64_t now_s);

class JobFiles {
 public:
  // `removal_clock`: by which files grow old.
  JobFiles(runtime::Clock& clock, const RemovalClock& removal_clock, DatabaseReader& reader,
           std::filesystem::path folder)
      : clock_{clock}, removal_clock_{removal_clock}, reader_{reader}, folder_{std::move(folder)} {}

  const std::filesystem::path& folder() const { return folder_; }

  // Removes drafts, what is too old, and files of jobs that are not done. Files that cannot be removed stay.
  boost::asio::awaitable<void> open();

  // Where the only running job writes; the folder is made, nothing is at the path. Throws when it cannot be made.
  boost::asio::awaitable<std::filesystem::path> begin_draft(JobId job);

  // The draft becomes the job's file, and what does not fit beside it is removed. invalid: it is larger than
  // kMaxJobFileBytes. Throws std::system_error.
  boost::asio::awaitable<Result<JobFile>> finish(JobId job, std::string ending);

  boost::asio::awaitable<void> remove(JobId job);  // its draft and its file

  boost::asio::awaitable<std::optional<JobFile>> find(JobId job);  // none: it has none any more

 private:
  std::int64_t old_by_s() const { return removal_clock_.utc_us() / 1'000'000; }

  runtime::Clock& clock_;
  const RemovalClock& removal_clock_;
  DatabaseReader& reader_;
  std::filesystem::path folder_;
};

}  // namespace server::storage
