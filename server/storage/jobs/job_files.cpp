// The folder is read for each question: it holds few files.
#include "server/storage/jobs/job_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <system_error>

#include "server/storage/database/finished_file.hpp"
#include "server/storage/jobs/job_store.hpp"

namespace server::storage {
namespace asio = boost::asio;
namespace fs = std::filesystem;

namespace {

constexpr const char* kDraftEnding = ".part";

// Takes a number and what follows it off the text.
std::optional<std::int64_t> take_number(std::string_view& text, char then) {
  std::int64_t number = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || rest == text.data() + text.size() || *rest != then) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(rest - text.data()) + 1);
  return number;
}

// None of a draft, or of what is no file of a job.
std::optional<JobFile> file_named(const fs::path& path) {
  const std::string name = path.filename().string();
  constexpr std::string_view kBeginning = "job-";
  std::string_view rest{name};
  if (!rest.starts_with(kBeginning) || rest.ends_with(kDraftEnding)) return std::nullopt;
  rest.remove_prefix(kBeginning.size());
  const auto job = take_number(rest, '-'), finished_at_s = take_number(rest, '.');
  if (!job || !finished_at_s) return std::nullopt;
  std::error_code gone;
  const std::uintmax_t size_bytes = fs::file_size(path, gone);
  if (gone) return std::nullopt;
  return JobFile{*job, *finished_at_s, std::string{rest}, path, size_bytes};
}

std::vector<fs::path> paths_in(const fs::path& folder) {
  std::vector<fs::path> paths;
  std::error_code none;
  for (const fs::directory_entry& entry : fs::directory_iterator{folder, none}) paths.push_back(entry.path());
  return paths;
}

std::vector<JobFile> files_in(const fs::path& folder) {
  std::vector<JobFile> files;
  for (const fs::path& path : paths_in(folder)) {
    if (auto file = file_named(path)) files.push_back(std::move(*file));
  }
  return files;
}

fs::path draft_in(const fs::path& folder, JobId job) { return folder / fmt::format("job-{}{}", job, kDraftEnding); }

void remove_drafts(const fs::path& folder) {
  std::error_code ignored;
  for (const fs::path& path : paths_in(folder)) {
    if (path.filename().string().contains(kDraftEnding)) fs::remove(path, ignored);  // and what SQLite put beside it
  }
}

void remove_surplus(const fs::path& folder, std::int64_t now_s) {
  const std::vector<JobFile> all = files_in(folder), kept = files_to_keep(all, now_s);
  std::error_code ignored;
  for (const JobFile& file : all) {
    if (std::ranges::find(kept, file.path, &JobFile::path) == kept.end()) fs::remove(file.path, ignored);
  }
}

void remove_not_done(SQLite::Database& database, const fs::path& folder) {
  std::error_code ignored;
  for (const JobFile& file : files_in(folder)) {
    const auto job = find_job(database, file.job);
    if (!job || job->state != JobState::done) fs::remove(file.path, ignored);
  }
}

}  // namespace

std::vector<JobFile> files_to_keep(std::vector<JobFile> files, std::int64_t now_s) {
  std::ranges::sort(files, std::ranges::greater{}, &JobFile::job);
  std::vector<JobFile> kept;
  std::uint64_t bytes = 0;
  for (JobFile& file : files) {
    bytes += file.size_bytes;
    if (kept.size() == kMaxJobFiles || bytes > kMaxJobFileBytes) break;
    if (file.finished_at_s + kJobFileAge.count() >= now_s) kept.push_back(std::move(file));
  }
  return kept;
}

asio::awaitable<void> JobFiles::open() {
  auto clean = [folder = folder_, now_s = old_by_s()](SQLite::Database& database) {
    remove_drafts(folder);
    remove_not_done(database, folder);
    remove_surplus(folder, now_s);
  };
  co_await reader_.ask(std::move(clean));
}

asio::awaitable<fs::path> JobFiles::begin_draft(JobId job) {
  auto begin = [folder = folder_, job] {
    fs::create_directories(folder);
    remove_drafts(folder);
    return draft_in(folder, job);
  };
  co_return co_await reader_.run(std::move(begin));
}

asio::awaitable<Result<JobFile>> JobFiles::finish(JobId job, std::string ending) {
  auto finish = [folder = folder_, job, ending, now_s = clock_.utc_us() / 1'000'000,
                 old_by_s = old_by_s()]() -> Result<JobFile> {
    const fs::path draft = draft_in(folder, job);
    JobFile file{job, now_s, ending, folder / fmt::format("job-{}-{}.{}", job, now_s, ending), fs::file_size(draft)};
    if (file.size_bytes > kMaxJobFileBytes) {
      remove_draft(draft);
      return fail(ErrorCode::invalid,
                  fmt::format("the file has {} bytes, at most {} are kept", file.size_bytes, kMaxJobFileBytes),
                  "too_large");
    }
    finish_file(draft, file.path);
    remove_surplus(folder, old_by_s);
    return file;
  };
  co_return co_await reader_.run(std::move(finish));
}

asio::awaitable<void> JobFiles::remove(JobId job) {
  auto remove = [folder = folder_, job] {
    remove_draft(draft_in(folder, job));
    std::error_code ignored;
    for (const JobFile& file : files_in(folder)) {
      if (file.job == job) fs::remove(file.path, ignored);
    }
  };
  co_await reader_.run(std::move(remove));
}

asio::awaitable<std::optional<JobFile>> JobFiles::find(JobId job) {
  auto find = [folder = folder_, job, now_s = old_by_s()]() -> std::optional<JobFile> {
    for (JobFile& file : files_to_keep(files_in(folder), now_s)) {
      if (file.job == job) return std::move(file);
    }
    return std::nullopt;
  };
  co_return co_await reader_.run(std::move(find));
}

}  // namespace server::storage
