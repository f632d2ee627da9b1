// One subcommand an act, each a request to the station; who waits asks again until the job has ended.
#include "server/cli/accounts/job.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <stdexcept>
#include <string>

#include "server/cli/accounts/account_access.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/terminal/input.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/cli/terminal/output.hpp"
#include "server/cli/terminal/progress.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

constexpr int kLook_ms = 500;  // between two looks at the progress
constexpr const char* kJobs = "/api/v1/jobs";

CLI::App* offer(CLI::App& command, JobCommand& options, JobCommand::Act act, const char* name, const char* purpose) {
  CLI::App* sub = command.add_subcommand(name, purpose);
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->add_flag("--json", options.json, "As JSON");
  sub->callback([&options, act] { options.act = act; });
  return sub;
}

void offer_number(CLI::App* sub, JobCommand& options) {
  sub->add_option("job", options.job, "Its number, as `rheonaut job list` shows it")
      ->required()
      ->check(whole(1, std::numeric_limits<std::int64_t>::max()));
}

json ask(const JobCommand& options, const std::string& method, const std::string& target, const json& body = nullptr) {
  return asked(StationClient{options.data_dir}.ask(method, target, body));
}

json read_request(const std::filesystem::path& file) {
  json request = read_json(file.string());
  if (request.is_object()) return request;
  throw std::runtime_error{
      fmt::format("'{}' is not a JSON object such as {{\"kind\":\"identify\",\"run_id\":1}}", file.string())};
}

std::string progress_of(const json& job) {
  const json& progress = job.at("progress");
  if (progress.is_null()) return "-";
  return fmt::format("{:.0f} %, {}", 100 * progress.at("share").get<double>(), progress.at("stage").get<std::string>());
}

json wait_for(const JobCommand& options, std::int64_t id) {
  Progress progress{fmt::format("job {}", id), {.is_json = options.json}};
  const std::string again = asks_for_job_again(id, options.data_dir);
  BusyWait busy{options.busy, fmt::format("job {} goes on without this command; {}", id, again)};
  const StationRequest look{"GET", fmt::format("{}/{}?wait_ms={}", kJobs, id, kLook_ms)};
  for (;;) {
    StationAnswer answer = StationClient{options.data_dir}.ask_at_once({look}, TimeLimit{}.time).front();
    if (answer.status == 0) throw std::runtime_error{fmt::format("{}; once it does, {}", answer.text, again)};
    if (busy.asks_again(answer)) continue;
    json job = asked(std::move(answer));
    if (!job.at("ended_at_us").is_null()) return job;
    progress.set_detail(fmt::format("{} {}", job.at("state").get<std::string>(), progress_of(job)));
  }
}

// Writes an ended job with its result; the tools read the result alone.
int write_ended(const JobCommand& options, const json& job, std::ostream& out) {
  const auto state = job.at("state").get<std::string>();
  const bool is_done = state == "done";
  if (options.json || is_done) fmt::print(out, "{}\n", (options.json ? job : job.at("result")).dump(2));
  if (is_done) return 0;
  const json& error = job.at("error");
  return not_done(kJobNotDone, fmt::format("job {} {}{}", job.at("job_id").get<std::int64_t>(), state,
                                           error.is_null() ? "" : ": " + error.get<std::string>()));
}

void write_jobs(std::ostream& out, const json& jobs) {
  Table table{{"id", "<state", "<kind", "<begun", "<by", "<progress"}};
  for (const json& job : jobs) {
    table.row({fmt::format("{}", job.at("job_id").get<std::int64_t>()), job.at("state"), job.at("kind"),
               time_text(job.at("created_at_us")), job.at("owner"), progress_of(job)});
  }
  table.write(out);
}

int list(const JobCommand& options, std::ostream& out) {
  const json jobs = ask(options, "GET", kJobs).at("jobs");
  if (options.json) {
    fmt::print(out, "{}\n", jobs.dump(2));
    return 0;
  }
  write_jobs(out, jobs);
  return 0;
}

int show(const JobCommand& options, std::ostream& out) {
  const json job =
      options.waits ? wait_for(options, options.job) : ask(options, "GET", fmt::format("{}/{}", kJobs, options.job));
  if (!job.at("ended_at_us").is_null()) return write_ended(options, job, out);
  if (options.json) {
    fmt::print(out, "{}\n", job.dump(2));
  } else {
    write_jobs(out, json::array({job}));
  }
  return 0;
}

int begin(const JobCommand& options, std::ostream& out) {
  const json job = ask(options, "POST", kJobs, read_request(options.file));
  const auto id = job.at("job_id").get<std::int64_t>();
  if (options.waits) return write_ended(options, wait_for(options, id), out);
  if (options.json) {
    fmt::print(out, "{}\n", job.dump(2));
  } else {
    fmt::print(out, "job {} waits; `rheonaut job show {} --wait` prints its result\n", id, id);
  }
  return 0;
}

int save_file(const JobCommand& options, std::ostream& out) {
  StationClient{options.data_dir}.save(fmt::format("{}/{}/file", kJobs, options.job), options.to,
                                       timeout(options.timeout_s));
  fmt::print(out, "{}\n", options.to.string());
  return 0;
}

int cancel(const JobCommand& options, std::ostream& out) {
  const json job = ask(options, "POST", fmt::format("{}/{}/cancel", kJobs, options.job));
  if (options.json) {
    fmt::print(out, "{}\n", job.dump(2));
  } else {
    fmt::print(out, "job {} {}\n", options.job,
               job.at("ended_at_us").is_null() ? "is being cancelled" : "is cancelled");
  }
  return 0;
}

}  // namespace

void add_options(CLI::App& command, JobCommand& options) {
  command.require_subcommand(1);
  CLI::App* begin = offer(command, options, JobCommand::Act::begin, "begin", "Ask for a computation on recorded runs");
  begin->add_option("file", options.file, "The request as JSON (docs/api.md, Jobs); -: standard input")
      ->required()
      ->check(named());
  begin->add_flag("--wait", options.waits, "Wait for its end and print its result");
  begin->footer(
      "Exit status 5: the job failed, was cancelled or interrupted.\n"
      "Example: echo '{\"kind\":\"identify\",\"run_id\":1}' | rheonaut job begin - --wait --data lab");
  offer(command, options, JobCommand::Act::list, "list", "List the jobs, newest first");
  CLI::App* show = offer(command, options, JobCommand::Act::show, "show", "Show one job, or its result");
  offer_number(show, options);
  show->add_flag("--wait", options.waits, "Wait for its end");
  CLI::App* file =
      offer(command, options, JobCommand::Act::file, "file", "Save the file that a report or export has made");
  offer_number(file, options);
  file->add_option("--to", options.to, "The file; one that is there is replaced")->required()->check(named());
  add_timeout_option(*file, options.timeout_s);
  offer_number(offer(command, options, JobCommand::Act::cancel, "cancel", "End a job that waits or runs"), options);
  command.footer("Example: rheonaut job list --data lab");
}

int run(const JobCommand& options, std::ostream& out) {
  switch (options.act) {
    case JobCommand::Act::begin: return begin(options, out);
    case JobCommand::Act::list: return list(options, out);
    case JobCommand::Act::show: return show(options, out);
    case JobCommand::Act::file: return save_file(options, out);
    case JobCommand::Act::cancel: return cancel(options, out);
  }
  return 0;
}

}  // namespace server::cli
