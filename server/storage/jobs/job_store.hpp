// SQL of the jobs: a row each, of which the newest kMaxKeptJobs that have ended are kept.
//
// Each call is one transaction. Errors: SQLite::Exception.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <optional>
#include <string>
#include <vector>

#include "server/storage/jobs/job.hpp"

namespace server::storage {

inline constexpr std::int64_t kMaxKeptJobs = 1000;

// A new one, which waits; its id.
JobId add_job(SQLite::Database& database, const JobRequest& request, std::int64_t utc_us);
void start_job(SQLite::Database& database, JobId id, std::int64_t utc_us);

// How it ended.
struct JobEnd {
  JobState state = JobState::done;
  std::string result;  // JSON; of one that is done
  std::string error;   // of one that failed
};
void end_job(SQLite::Database& database, JobId id, const JobEnd& end, std::int64_t utc_us);

// Those that have not ended are interrupted; how many.
int interrupt_jobs(SQLite::Database& database, std::int64_t utc_us);

std::optional<Job> find_job(SQLite::Database& database, JobId id);
std::optional<std::string> job_result(SQLite::Database& database, JobId id);  // none: there is no job, or no result
// Newest first, below `before` (0: from the newest).
std::vector<Job> list_jobs(SQLite::Database& database, JobId before, std::size_t limit);

}  // namespace server::storage
