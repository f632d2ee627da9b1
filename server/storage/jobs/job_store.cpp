// A statement or two for each call.
#include "server/storage/jobs/job_store.hpp"

#include <fmt/format.h>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

constexpr const char* kJobColumns =
    "job_id, kind, state, owner, request, created_at_us, started_at_us, ended_at_us, error";

std::optional<std::int64_t> optional_time(const SQLite::Column& column) {
  return column.isNull() ? std::nullopt : std::optional{column.getInt64()};
}

Job job_of(SQLite::Statement& row) {
  Job job;
  job.id = row.getColumn(0).getInt64();
  job.request.kind = row.getColumn(1).getString();
  job.state = job_state_from(row.getColumn(2).getString()).value_or(JobState::interrupted);
  job.request.owner = row.getColumn(3).getString();
  job.request.document = row.getColumn(4).getString();
  job.created_at_us = row.getColumn(5).getInt64();
  job.started_at_us = optional_time(row.getColumn(6));
  job.ended_at_us = optional_time(row.getColumn(7));
  job.error = row.getColumn(8).getString();
  return job;
}

}  // namespace

JobId add_job(SQLite::Database& database, const JobRequest& request, std::int64_t utc_us) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement add{database,
                        "INSERT INTO job (kind, state, owner, request, created_at_us) VALUES (?, 'waiting', ?, ?, ?)"};
  execute(add, request.kind, request.owner, request.document, utc_us);
  const JobId id = database.getLastInsertRowid();
  SQLite::Statement forget{database,
                           "DELETE FROM job WHERE ended_at_us IS NOT NULL AND job_id <= (SELECT job_id FROM job"
                           " WHERE ended_at_us IS NOT NULL ORDER BY job_id DESC LIMIT 1 OFFSET ?)"};
  execute(forget, kMaxKeptJobs);
  transaction.commit();
  return id;
}

void start_job(SQLite::Database& database, JobId id, std::int64_t utc_us) {
  SQLite::Statement start{database, "UPDATE job SET state = 'running', started_at_us = ? WHERE job_id = ?"};
  execute(start, utc_us, id);
}

void end_job(SQLite::Database& database, JobId id, const JobEnd& end, std::int64_t utc_us) {
  SQLite::Statement update{database,
                           "UPDATE job SET state = ?, ended_at_us = ?, result = nullif(?, ''), error = nullif(?, '')"
                           " WHERE job_id = ?"};
  execute(update, text(end.state), utc_us, end.result, end.error, id);
}

int interrupt_jobs(SQLite::Database& database, std::int64_t utc_us) {
  SQLite::Statement update{database, "UPDATE job SET state = 'interrupted', ended_at_us = ? WHERE ended_at_us IS NULL"};
  bind_all(update, utc_us);
  return update.exec();
}

std::optional<Job> find_job(SQLite::Database& database, JobId id) {
  SQLite::Statement row{database, fmt::format("SELECT {} FROM job WHERE job_id = ?", kJobColumns)};
  bind_all(row, id);
  if (!row.executeStep()) return std::nullopt;
  return job_of(row);
}

std::optional<std::string> job_result(SQLite::Database& database, JobId id) {
  SQLite::Statement row{database, "SELECT result FROM job WHERE job_id = ? AND result IS NOT NULL"};
  bind_all(row, id);
  if (!row.executeStep()) return std::nullopt;
  return row.getColumn(0).getString();
}

std::vector<Job> list_jobs(SQLite::Database& database, JobId before, std::size_t limit) {
  std::vector<Job> jobs;
  SQLite::Statement rows{
      database,
      fmt::format("SELECT {} FROM job WHERE ?1 = 0 OR job_id < ?1 ORDER BY job_id DESC LIMIT ?2", kJobColumns)};
  bind_all(rows, before, static_cast<std::int64_t>(limit));
  while (rows.executeStep()) jobs.push_back(job_of(rows));
  return jobs;
}

}  // namespace server::storage
