// Requests with an end, one after the other.
#include "server/cli/commission/robot_access.hpp"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <set>
#include <stdexcept>

#include "server/cli/commission/plan.hpp"
#include "server/cli/experiments/station_work.hpp"
#include "server/runtime/clock.hpp"
#include "server/runtime/exceptions.hpp"

namespace server::cli {
namespace {

using nlohmann::json;

constexpr microseconds kPatience{8'000'000};      // of a request; a verified command takes 5 s at most
constexpr microseconds kStopPatience{7'000'000};  // SAFETY: as of `rheonaut stop`
constexpr std::chrono::milliseconds kLook{20};
constexpr std::int64_t kReleasePatienceUs = 2'000'000;
constexpr std::int64_t kLatchedWithinUs = 5'000'000, kBeginsWithinUs = 50'000'000, kEndsLateUs = 30'000'000;
constexpr std::int64_t kDigestWithinUs = 10'000'000, kFitWithinUs = 120'000'000;
constexpr std::int64_t kFitWaitsUs = 600'000'000;  // behind the computations of others
constexpr int kFitTimeLimitS = 110, kControlMs = 15'000, kPage = 1000;
constexpr std::int64_t kControlAgainUs = 5'000'000;
constexpr std::int64_t kAliveUs = 400'000;          // SAFETY: after so long a silence the station pauses a run
constexpr microseconds kBeginPatience{30'000'000};  // of an experiment's request, which computes; nothing moves yet
constexpr double kUsOfS = 1e6;

constexpr const char* kExperiments = "/api/v1/experiments";

// The end of a wait.
class Deadline {
 public:
  explicit Deadline(std::int64_t within_us) : ends_us_{clock_.steady_us() + within_us} {}
  bool is_over() const { return clock_.steady_us() > ends_us_; }
  void begin_again(std::int64_t within_us) { ends_us_ = clock_.steady_us() + within_us; }

 private:
  boost::asio::io_context loop_;
  runtime::SystemClock clock_{loop_};
  std::int64_t ends_us_;
};

double number_or_0(const json& value) { return value.is_number() ? value.get<double>() : 0; }

std::optional<double> number_or_none(const json& value) {
  return value.is_number() ? std::optional{value.get<double>()} : std::nullopt;
}

}  // namespace

RecordedSample sample_in(const json& row) {
  return {row.at("robot_time_us").get<std::int64_t>(),
          number_or_0(row.at("position_m")),
          number_or_none(row.at("position_sd_m")),
          number_or_0(row.at("acceleration_m_s2")),
          number_or_0(row.at("duty")),
          number_or_0(row.at("impedance_mv")),
          row.at("flags").get<long>()};
}

namespace {

std::int64_t steady_us() {
  boost::asio::io_context loop;
  return runtime::SystemClock{loop}.steady_us();
}

std::string text_or(const json& object, const char* name, const char* other) {
  const json value = object.is_object() ? object.value(name, json()) : json();
  return value.is_string() ? value.get<std::string>() : other;
}

}  // namespace

bool has_repeated_step(const json& run) {
  std::set<long> begun;
  for (const json& one : run.at("steps")) {
    if (!begun.insert(one.at("step").get<long>()).second) return true;
  }
  return false;
}

RobotAccess::RobotAccess(const std::filesystem::path& data_dir, std::string robot_id, Interruption& interruption)
    : client_{data_dir},
      path_{"/api/v1/robots/" + robot_id},
      robot_id_{std::move(robot_id)},
      interruption_{interruption} {
  boost::asio::io_context loop;
  notes_ = fmt::format("rheonaut robot commission, begun at {} us", runtime::SystemClock{loop}.utc_us());
}

StationAnswer RobotAccess::ask(const std::string& method, const std::string& target, const json& body) const {
  interruption_.throw_if_come();
  const microseconds patience = target == kExperiments ? kBeginPatience : kPatience;
  StationAnswer answer = client_.ask_at_once({{method, target, body}}, patience).front();
  interruption_.throw_if_come();
  if (answer.status == 0) throw std::runtime_error{answer.text};
  return answer;
}

json RobotAccess::parameters() const {
  json by_name = json::object();
  const json known = get(path_ + "/parameters").at("parameters");
  if (known.is_null()) throw std::runtime_error{"the robot has not reported its parameters yet; try again"};
  for (const json& one : known) by_name[one.at("name").get<std::string>()] = one.at("value");
  return by_name;
}

void RobotAccess::take_control() {
  post(path_ + "/control", {{"action", "take"}, {"lease_ms", kControlMs}});
  controlled_us_ = steady_us();
}

void RobotAccess::keep_control() {
  if (steady_us() - controlled_us_ > kControlAgainUs) take_control();
}

void RobotAccess::release_control() const noexcept {
  try {
    client_.ask_at_once({{"POST", path_ + "/control", {{"action", "release"}}}}, microseconds{kReleasePatienceUs});
  } catch (const std::exception&) {  // no memory or descriptor for the request; the lease ends by itself
  }
}

StopAnswer RobotAccess::stop() const {
  StopAnswer outcome;
  StationAnswer answer;
  try {
    answer = client_.ask_at_once({{"POST", path_ + "/emergency-stop"}}, kStopPatience).front();
  } catch (const std::exception& error) {
    outcome.why = runtime::text_of(error);
    return outcome;
  }
  const json record = answer.body.is_object() ? answer.body : json::object();
  const std::string state = text_or(record, "state", "");
  // SAFETY: only what the robot itself has acknowledged counts as a stop; sent or queued is not enough.
  outcome.is_confirmed = state == "acknowledged" || state == "verified";
  outcome.confirmed_ms = number_or_0(record.value("acknowledged_after_us", json())) / 1e3;
  outcome.emergency_id = text_or(record, "emergency_id", "");
  if (!outcome.is_confirmed) {
    outcome.why = answer.status == 0 ? answer.text
                  : state.empty()    ? "the station refused: " + text_or(record, "detail", "no reason")
                                     : "the robot has not answered; the stop is kept and repeated";
  }
  return outcome;
}

void RobotAccess::reset(const std::string& emergency_id) const {
  const Deadline latched{kLatchedWithinUs};
  for (;;) {
    const json now = state();
    const json duty = now.at("sample").is_null() ? json() : now.at("sample").at("duty");
    if (now.at("mode") == "emergency" && duty == 0.0) break;
    if (latched.is_over()) throw std::runtime_error{"the robot confirmed a stop and does not show it in its telemetry"};
    interruption_.wait(kLook);
  }
  const json record =
      post(path_ + "/commands?wait=verified", {{"kind", "clear_emergency"}, {"emergency_id", emergency_id}});
  if (record.at("state") != "verified") {
    throw std::runtime_error{fmt::format("the emergency was not reset: {} ({})", text_or(record, "state", "?"),
                                         text_or(record, "reason", ""))};
  }
}

StopAnswer RobotAccess::stop_and_end() {
  StopAnswer outcome = stop();
  try {
    if (has_experiment_) abort_own_experiments();
  } catch (const std::exception&) {  // an answer that is none; the station holds what waits after a stop
  }
  return outcome;
}

// SAFETY: what waits would push the robot later.
void RobotAccess::abort_own_experiments() const {
  const std::string list = "/api/v1/experiments?limit=100&robot_id=" + robot_id_;
  const json found = client_.ask_at_once({{"GET", list}}, kPatience).front().body;
  for (const json& one : found.is_object() ? found.value("experiments", json::array()) : json::array()) {
    if (one.value("notes", "") != notes_ || !one.at("ended_at_us").is_null()) continue;
    const std::string target = fmt::format("/api/v1/experiments/{}/abort", one.at("experiment_id").get<std::int64_t>());
    client_.ask_at_once({{"POST", target, {{"reason", "the commissioning has ended"}}}}, kPatience);
  }
}

RecordedRun RobotAccess::perform(const json& profile) {
  take_control();
  Deadline alive{kBeginsWithinUs};  // until the first sign of life
  const auto ask_station = [this, &alive](const std::string& method, const std::string& target, const json& body) {
    if (target.ends_with("/keep-alive")) {
      // SAFETY: the station pauses a run without signs of life; the next one would let it go on, with nobody asked.
      if (alive.is_over()) throw std::runtime_error{"this computer stood still while the robot moved"};
      alive.begin_again(kAliveUs);
    }
    return ask(method, target, body);
  };
  const Deadline begins{kBeginsWithinUs};
  const Deadline ends{kBeginsWithinUs + kEndsLateUs + static_cast<std::int64_t>(kUsOfS * duration_of(profile))};
  // SAFETY: a wait for something that does not come ends, and with it the signs of life.
  const StationWork work{ask_station, [&](const json& experiment) {
                           if (experiment.at("state") == "waiting" && begins.is_over()) {
                             throw std::runtime_error{fmt::format("the experiment does not begin: {} {}",
                                                                  text_or(experiment, "waits_for", ""),
                                                                  text_or(experiment, "waits_for_detail", ""))};
                           }
                           if (experiment.at("state") == "paused") {
                             throw std::runtime_error{fmt::format("the experiment is paused: {}",
                                                                  text_or(experiment, "detail", "no reason"))};
                           }
                           if (ends.is_over()) throw std::runtime_error{"the experiment does not end"};
                         }};
  has_experiment_ = true;  // also when its answer is lost
  const json begun = work.post(kExperiments, {{"robot_id", robot_id_}, {"profile", profile}, {"notes", notes_}});
  const json ended = work.finished_experiment(begun.at("experiment_id").get<std::int64_t>());
  has_experiment_ = false;
  if (ended.at("state") != "done") {
    throw std::runtime_error{fmt::format("the experiment was {}: {} {}", text_or(ended, "state", "?"),
                                         text_or(ended, "reason", ""), text_or(ended, "detail", ""))};
  }
  // SAFETY: a step that was repeated needs a way that nobody was asked about.
  if (has_repeated_step(ended.at("runs").front())) throw std::runtime_error{"the station had to repeat a step"};
  RecordedRun run;
  run.run_id = ended.at("runs").front().at("run_id").get<std::int64_t>();
  run.samples = samples_of(run.run_id);
  run.reference = reference_of(run.run_id, text_or(profile, "name", ""));
  return run;
}

std::vector<RecordedSample> RobotAccess::samples_of(std::int64_t run_id) const {
  std::vector<RecordedSample> samples;
  std::string after;
  do {
    const json page = get(fmt::format("/api/v1/runs/{}/samples?limit={}{}", run_id, kPage, after));
    for (const json& row : page.at("samples")) samples.push_back(sample_in(row));
    after = page.at("next").is_string() ? "&after=" + page.at("next").get<std::string>() : "";
  } while (!after.empty());
  return samples;
}

nlohmann::ordered_json RobotAccess::reference_of(std::int64_t run_id, const std::string& purpose) const {
  const std::string target = fmt::format("/api/v1/runs/{}/certificate", run_id);
  const Deadline deadline{kDigestWithinUs};
  json digest = get(target);
  while (digest.at("final") != true && !deadline.is_over()) {
    interruption_.wait(kLook);
    digest = get(target);
  }
  return {{"run_id", run_id},
          {"purpose", purpose},
          {"samples_expected", digest.value("samples_expected", json())},
          {"samples_lost", digest.value("samples_lost", json())},
          {"sha256", digest.value("sha256", json())}};
}

DutyAnswer duty_answer(const StationAnswer& answer) {
  const json body = answer.body.is_object() ? answer.body : json::object();
  const json record = body.value("command", body);
  const std::string state = text_or(record, "state", "");
  const bool is_out_of_range = text_or(record, "reason", "") == "out_of_range";
  constexpr int kInvalid = 422;
  if (state == "acknowledged" || state == "verified") return DutyAnswer::taken;
  if (state == "rejected" && is_out_of_range) return DutyAnswer::refused_by_robot;
  if (state.empty() && answer.status == kInvalid && is_out_of_range) return DutyAnswer::refused_by_station;
  return DutyAnswer::none;
}

DutyAnswer RobotAccess::try_duty(double duty) const {
  const json body{{"kind", "set_duty"}, {"duty", duty}, {"lease_ms", 1}};
  return duty_answer(ask("POST", path_ + "/commands", body));
}

json RobotAccess::fit(std::int64_t run_id, std::string& failure) const {
  const json body{{"kind", "identify"},
                  {"run_id", run_id},
                  {"structure", "second_order"},
                  {"cut_at_gaps", true},
                  {"time_limit_s", kFitTimeLimitS}};
  const auto id = post("/api/v1/jobs", body).at("job_id").get<std::int64_t>();
  const Deadline waits{kFitWaitsUs};
  Deadline computes{kFitWithinUs};
  BusyWait busy;
  for (;;) {
    const StationAnswer answer = ask("GET", fmt::format("/api/v1/jobs/{}?wait_ms=500", id), nullptr);
    const bool is_busy = busy.asks_again(answer);
    const json job = is_busy ? json{{"state", "running"}, {"ended_at_us", nullptr}} : asked(answer);
    if (job.at("state") == "done") return job.at("result");
    if (!job.at("ended_at_us").is_null()) {
      failure = text_or(job, "error", "the computation did not end well");
      return nullptr;
    }
    if (job.at("state") == "waiting" && !waits.is_over()) computes.begin_again(kFitWithinUs);
    if (!computes.is_over()) continue;
    failure = "the computation took longer than 2 minutes";
    post(fmt::format("/api/v1/jobs/{}/cancel", id), json::object());
    return nullptr;
  }
}

std::string RobotAccess::set_parameter(const std::string& name, double value) const {
  const StationAnswer answer =
      ask("POST", path_ + "/commands?wait=verified", {{"kind", "set_parameter"}, {"name", name}, {"value", value}});
  if (answer.status == 200 && answer.body.value("state", "") == "verified") return {};
  return answer.status == 200 ? "the robot has not reported it" : text_or(answer.body, "detail", "refused");
}

std::string RobotAccess::mark(const std::string& line) const {
  constexpr int kFirstProblem = 300;
  try {
    const StationAnswer answer =
        client_.ask_at_once({{"POST", path_ + "/markers", {{"text", line}}}}, kPatience).front();
    if (answer.status != 0 && answer.status < kFirstProblem) return {};
    return answer.status == 0 ? answer.text : text_or(answer.body, "detail", "refused");
  } catch (const std::exception& error) {  // a name that is no UTF-8; the record is signed already
    return runtime::text_of(error);
  }
}

}  // namespace server::cli
