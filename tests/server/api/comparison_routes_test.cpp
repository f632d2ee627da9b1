// Comparisons over the routes: traces, impedance, the report; and the jobs that make documents, with their files.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <fstream>
#include <limits>

#include "server/analysis/report/comparison_report.hpp"
#include "server/api/bodies/document_body.hpp"
#include "server/storage/jobs/job_files.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class ComparisonTest : public ApiTest {
 protected:
  ComparisonTest() { connect_robot(); }

  // A run that rests for 0.5 s and then steers to the setpoint.
  void record(float setpoint_m, const json& more = json::object()) {
    json body{{"robot_id", "r1"}, {"name", fmt::format("to {} m", setpoint_m)}};
    body.update(more);
    const Answered made = ask("POST", "/api/v1/runs", body);
    ASSERT_EQ(made.status, 201) << made.body;
    for (int frame = 0; frame < 2; ++frame) send({});
    for (int frame = 0; frame < 4; ++frame) send(setpoint_m);
    ASSERT_EQ(ask("POST", fmt::format("/api/v1/runs/{}/end", made.parsed()["run_id"].get<int>())).status, 200);
  }
  void send(std::optional<float> setpoint_m) {
    constexpr pb_size_t kSamples = 25;
    auto frame = TestRobot::samples_frame(next_seq_, kSamples, 1'000'000 + next_seq_ * 10'000, 0);
    protocol::Telemetry& telemetry = frame.body.telemetry;
    telemetry.position_sd_m = unknown_frames_-- > 0 ? std::numeric_limits<float>::quiet_NaN() : 0.002F;
    if (setpoint_m) {
      telemetry.mode = rheonaut_MODE_AUTO;
      telemetry.has_setpoint_m = true;
      telemetry.setpoint_m = *setpoint_m;
    }
    for (pb_size_t i = 0; i < kSamples; ++i) {
      telemetry.position_m[i] = position_m_;
      telemetry.impedance_mv[i] = position_m_ > 0.04F ? 120 : 175;
      position_m_ += 0.1F * (setpoint_m.value_or(position_m_) - position_m_);
    }
    next_seq_ += kSamples;
    robot->send(frame);
    clock.run_for(250ms);
  }
  void detect(std::uint64_t seq) {
    protocol::RobotFrame frame = rheonaut_RobotFrame_init_zero;
    frame.which_body = rheonaut_RobotFrame_event_tag;
    frame.body.event.event_robot_time_us = 1'000'000 + seq * 10'000;
    frame.body.event.event_seq = next_event_++;
    frame.body.event.kind = rheonaut_EVENT_KIND_DETECTION;
    frame.body.event.sample_seq = seq;
    frame.body.event.value = 120;
    robot->send(frame);
    clock.run_for(250ms);
  }
  json ended(int job_id) {
    const json job = ask("GET", fmt::format("/api/v1/jobs/{}?wait_ms=9000", job_id)).parsed();
    EXPECT_NE(job["ended_at_us"], nullptr) << job;
    return job;
  }
  json done(const json& body) {
    const Answered begun = ask("POST", "/api/v1/jobs", body);
    EXPECT_EQ(begun.status, 202) << begun.body;
    const json job = ended(begun.parsed()["job_id"].get<int>());
    EXPECT_EQ(job["state"], "done") << job;
    return job;
  }

  std::uint64_t next_seq_ = 0, next_event_ = 0;
  int unknown_frames_ = 0;  // of the next ones, whose position has no sd

 private:
  float position_m_ = 0;
};

TEST_F(ComparisonTest, TracesStandOnOneAxis) {
  record(0.1F);
  record(0.2F);
  const Answered answer = ask("GET", "/api/v1/run-comparison/traces?runs=1,2&at=step&channels=position_m,setpoint_m");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const json compared = answer.parsed();
  EXPECT_EQ(compared["grid_s"], 0.01);
  const json& first = compared["runs"][0];
  EXPECT_EQ(first["aligned_at_s"], 0.5);
  EXPECT_EQ(compared["time_s"].size(), 150U);
  EXPECT_EQ(compared["time_s"][0], -0.5);
  EXPECT_EQ(first["position_source"], "estimate");
  EXPECT_EQ(first["position_sd_m"][0], 0.002);
  EXPECT_EQ(first["differences"], nullptr);
  EXPECT_EQ(first["traces"]["setpoint_m"][49], nullptr) << "in manual there is none";
  EXPECT_EQ(first["traces"]["setpoint_m"][50], 0.1);
  const json& second = compared["runs"][1];
  EXPECT_NEAR(second["differences"]["setpoint_m"][60].get<double>(), 0.1, 1e-6);
  EXPECT_NEAR(second["difference_sd_m"][60].get<double>(), 0.002 * std::sqrt(2), 1e-6);
  const json part =
      ask("GET", "/api/v1/run-comparison/traces?runs=1,2&from_ms=100&to_ms=300&grid_us=100000&reference_run_id=2")
          .parsed();
  EXPECT_THAT(part["time_s"], ElementsAre(0.1, 0.2, 0.3));
  EXPECT_EQ(part["runs"][1]["differences"], nullptr);
  EXPECT_EQ(part["reference_run_id"], 2);
}

TEST_F(ComparisonTest, ARunWithoutWhatItIsAlignedAtIsNamed) {
  record(0.1F);
  detect(60);
  record(0.2F);
  const Answered refused = ask("GET", "/api/v1/run-comparison/traces?runs=1,2&at=event&event=detection");
  EXPECT_EQ(refused.status, 422);
  EXPECT_EQ(refused.parsed()["detail"], "run 2 ('to 0.2 m') has no event detection 1, none");
  EXPECT_EQ(refused.parsed()["reason"], "nothing_to_align");
  detect(220);
  const json compared = ask("GET", "/api/v1/run-comparison/traces?runs=1,2&at=event&event=detection").parsed();
  EXPECT_EQ(compared["runs"][0]["aligned_at_s"], 0.6);
  EXPECT_EQ(compared["runs"][1]["aligned_at_s"], 0.7);
  ASSERT_EQ(ask("POST", "/api/v1/robots/r1/markers", {{"text", "a 'valve'"}}).status, 201);
  EXPECT_THAT(ask("GET", "/api/v1/run-comparison/traces?runs=1,2&at=marker").parsed()["detail"].get<std::string>(),
              HasSubstr("run 1 ('to 0.1 m') has no marker 1, none"));
}

TEST_F(ComparisonTest, RefusesWhatDoesNotFit) {
  record(0.1F);
  record(0.2F);
  struct Case {
    const char* query;
    int status;
    const char* words;
  };
  const Case cases[] = {
      {"", 400, "runs is missing"},
      {"?runs=1", 400, "allowed are 2 to 12"},
      {"?runs=1,1", 422, "runs has 1 twice"},
      {"?runs=1,9", 404, "9"},
      {"?runs=1,2&at=noon", 422, "at is 'noon'"},
      {"?runs=1,2&at=event", 400, "event is missing"},
      {"?runs=1,2&at=event&event=party", 422, "no kind of event"},
      {"?runs=1,2&event=detection", 422, "event needs at = event, which is start"},
      {"?runs=1,2&marker=x", 422, "marker needs at = marker"},
      {"?runs=1,2&at=step&number=0", 422, "number = 0 is outside"},
      {"?runs=1,2&number=2", 422, "a run has one start"},
      {"?runs=1,2&channels=colour", 422, "there are position_m, velocity_m_s"},
      {"?runs=1,2&channels=duty,duty", 422, "duty twice"},
      {"?runs=1,2&grid_us=5000", 422, "grid_us = 5000 is outside"},
      {"?runs=1,2&grid_us=1e4", 400, "no whole number"},
      {"?runs=1,2&from_ms=5&to_ms=5", 422, "it must be before to_ms"},
      {"?runs=1,2&from_ms=5000", 422, "no run has a sample"},
      {"?runs=1,2&reference_run_id=3", 422, "none of the runs"},
  };
  for (const Case& wrong : cases) {
    const Answered answer = ask("GET", std::string{"/api/v1/run-comparison/traces"} + wrong.query);
    EXPECT_EQ(answer.status, wrong.status) << wrong.query << answer.body;
    EXPECT_THAT(answer.parsed()["detail"].get<std::string>(), HasSubstr(wrong.words)) << wrong.query;
  }
  for (const char* route : {"report.html", "impedance-map"}) {
    EXPECT_EQ(ask("GET", fmt::format("/api/v1/run-comparison/{}?runs=1", route)).status, 400) << route;
    EXPECT_EQ(ask("GET", fmt::format("/api/v1/run-comparison/{}?runs=1,9", route)).status, 404) << route;
  }
}

TEST_F(ComparisonTest, ImpedanceIsMappedOverPosition) {
  record(0.1F);
  detect(70);
  record(0.05F);
  const json map = ask("GET", "/api/v1/runs/1/impedance-map?bin_mm=10").parsed();
  EXPECT_EQ(map["samples"], 150);
  EXPECT_THAT(map["position_sources"], ElementsAre("estimate"));
  EXPECT_EQ(map["forward"]["from_m"][0], 0);
  EXPECT_EQ(map["forward"]["mean_mv"][0], 175);
  EXPECT_EQ(map["forward"]["min_mv"].back(), 120);
  EXPECT_EQ(map["events"][0]["kind"], "detection");
  EXPECT_EQ(map["events"][0]["at_s"], 0.7);
  EXPECT_TRUE(map["backward"]["from_m"].empty());
  const json both = ask("GET", "/api/v1/run-comparison/impedance-map?runs=1,2").parsed();
  EXPECT_EQ(both["together"]["samples"], 300);
  EXPECT_FALSE(both["runs"][1]["backward"]["from_m"].empty()) << "it came back from 0.1 m";
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/impedance-map?bin_mm=0").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/runs/9/impedance-map").status, 404);
}

TEST_F(ComparisonTest, TheReportShowsAllOfIt) {
  record(0.1F, {{"tube", "narrow"}, {"notes", "<script>"}});
  detect(70);
  record(0.2F, {{"tube", "<b>wide</b>"}});
  clock.run_for(5s);
  const Answered report = ask("GET", "/api/v1/run-comparison/report.html?runs=1,2&at=step");
  ASSERT_EQ(report.status, 200) << report.body;
  EXPECT_THAT(report.body,
              AllOf(HasSubstr("Comparison of 2 runs"), HasSubstr("Aligned at step 1; differences are from run 1."),
                    HasSubstr("setpoint of run 1"), HasSubstr("± 2 sd"), HasSubstr("Position less that of run 1 (m)"),
                    HasSubstr("settling_s"), HasSubstr("Impedance over position"), HasSubstr("detection")));
  EXPECT_THAT(report.body, HasSubstr("<th class=\"differs\">Tube</th>"));
  EXPECT_THAT(report.body, HasSubstr("&lt;b&gt;wide&lt;/b&gt;"));
  const json certificate = ask("GET", "/api/v1/runs/2/certificate").parsed();
  EXPECT_THAT(report.body, HasSubstr(certificate["sha256"].get<std::string>()));
  EXPECT_THAT(report.body, AllOf(Not(HasSubstr("<script")), Not(HasSubstr("http:")), Not(HasSubstr("src=\"")),
                                 Not(HasSubstr("url("))));
}

TEST_F(ComparisonTest, ItsReportSaysOfHowManyPositionsTheUncertaintyIsNotKnown) {
  unknown_frames_ = 4;
  record(0.1F);
  unknown_frames_ = 6;
  record(0.2F);
  record(0.1F);
  const std::string report = ask("GET", "/api/v1/run-comparison/report.html?runs=1,2,3").body;
  EXPECT_THAT(report, AllOf(HasSubstr(">0.004; of "), HasSubstr(">not known</td>"), HasSubstr(">0.004</td>")));
}

TEST_F(ComparisonTest, AComparisonIsAJobToo) {
  record(0.1F);
  record(0.2F);
  const json job = done({{"kind", "comparison"}, {"runs", {1, 2}}, {"traces", {{"at", "step"}, {"channels", "duty"}}}});
  EXPECT_EQ(job["result"]["traces"]["runs"][1]["aligned_at_s"], 0.5);
  EXPECT_FALSE(job["result"]["metrics"]["figures"].empty());
  EXPECT_EQ(ask("GET", "/api/v1/jobs/1/file").parsed()["reason"], "no_file");
}

TEST_F(ComparisonTest, ReportsAndExportsOfJobsAreFiles) {
  record(0.1F);
  record(0.2F);
  clock.run_for(5s);
  const json one = done({{"kind", "report"}, {"runs", {1}}});
  EXPECT_EQ(one["result"]["path"], "/api/v1/jobs/1/file");
  const Answered html = ask("GET", "/api/v1/jobs/1/file");
  EXPECT_THAT(html.body, HasSubstr("<h1>to 0.1 m</h1>"));
  EXPECT_EQ(html.body.size(), one["result"]["size_bytes"]);
  done({{"kind", "report"}, {"runs", {1, 2}}, {"traces", {{"at", "step"}}}});
  EXPECT_THAT(ask("GET", "/api/v1/jobs/2/file").body, HasSubstr("Comparison of 2 runs"));
  done({{"kind", "export"}, {"run_id", 1}, {"format", "csv"}, {"channels", "duty"}});
  EXPECT_EQ(ask("GET", "/api/v1/jobs/3/file").body, ask("GET", "/api/v1/runs/1/samples.csv?channels=duty").body);
  done({{"kind", "export"}, {"run_id", 1}, {"format", "sqlite"}});
  EXPECT_TRUE(ask("GET", "/api/v1/jobs/4/file").body.starts_with("SQLite format 3"));
  done({{"kind", "export"}, {"run_id", 1}, {"format", "mat"}, {"grid_us", 20'000}});
  EXPECT_GT(ask("GET", "/api/v1/jobs/5/file").body.size(), 1000U);
  done({{"kind", "export"}, {"run_id", 1}, {"format", "mcap"}});
  const std::pair<int, const char*> types[] = {{1, "text/html; charset=utf-8"},
                                               {3, "text/csv; charset=utf-8"},
                                               {4, "application/vnd.sqlite3"},
                                               {5, "application/x-matlab-data"},
                                               {6, "application/octet-stream"}};
  for (const auto& [number, type] : types) {
    EXPECT_EQ(ask("GET", fmt::format("/api/v1/jobs/{}/file", number)).response.content_type, type);
  }
  for (const auto& entry : std::filesystem::directory_iterator{folder.path() / "job-files"}) {
    EXPECT_FALSE(entry.path().string().contains(".part")) << entry.path();
  }
  scopes = identity::Scopes::of(identity::Role::viewer);
  EXPECT_EQ(ask("GET", "/api/v1/jobs/1/file").status, 403);
}

TEST_F(ComparisonTest, ADocumentThatCannotBeMadeLeavesNoFile) {
  record(0.1F);
  record(0.2F);
  const Answered begun =
      ask("POST", "/api/v1/jobs", {{"kind", "report"}, {"runs", {1, 2}}, {"traces", {{"at", "disturbance"}}}});
  ASSERT_EQ(begun.status, 202) << begun.body;
  const json job = ended(1);
  EXPECT_EQ(job["state"], "failed");
  EXPECT_EQ(job["error"], "run 1 ('to 0.1 m') has no disturbance 1, none");
  EXPECT_EQ(ask("GET", "/api/v1/jobs/1/file").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/jobs/7/file").status, 404);
  EXPECT_EQ(ask("POST", "/api/v1/jobs", {{"kind", "report"}, {"runs", {1, 9}}}).status, 404);
}

TEST(ParseDocumentJob, SaysWhichMemberIsWrong) {
  struct Case {
    json body;
    const char* words;
  };
  const Case cases[] = {
      {{{"kind", "report"}}, "runs is missing"},
      {{{"kind", "report"}, {"runs", json::array()}}, "runs has 0, allowed are 1 to 12"},
      {{{"kind", "report"}, {"runs", {1}}, {"traces", json::object()}}, "traces are of several runs"},
      {{{"kind", "report"}, {"runs", {1, 2}}, {"traces", {{"channels", "duty"}}}}, "channels are those of the report"},
      {{{"kind", "comparison"}, {"runs", {1}}}, "runs has 1, allowed are 2 to 12"},
      {{{"kind", "comparison"}, {"runs", {1, 0}}}, "runs[] = 0 is outside"},
      {{{"kind", "comparison"}, {"runs", {1, 2}}, {"traces", 3}}, "traces is no object"},
      {{{"kind", "comparison"}, {"runs", {1, 2}}, {"traces", {{"where", 3}}}}, "\"where\" is not known here"},
      {{{"kind", "export"}, {"run_id", 1}}, "format is missing"},
      {{{"kind", "export"}, {"run_id", 1}, {"format", "xls"}}, "allowed are csv, mat, sqlite"},
      {{{"kind", "export"}, {"run_id", 1}, {"format", "sqlite"}, {"grid_us", 1000}}, "leave out channels and grid_us"},
      {{{"kind", "export"}, {"run_id", 1}, {"format", "csv"}, {"grid_us", 1}}, "grid_us = 1 is outside"},
      {{{"kind", "export"}, {"run_id", 1}, {"format", "csv"}, {"channels", "x"}}, "x"},
      {{{"kind", "export"}, {"runs", {1}}, {"format", "csv"}}, "\"runs\" is not known here"},
  };
  for (const Case& wrong : cases) {
    const auto parsed = api::parse_document_job(wrong.body["kind"], api::Members{wrong.body});
    ASSERT_FALSE(parsed) << wrong.body;
    EXPECT_THAT(parsed.error().detail, HasSubstr(wrong.words)) << wrong.body;
  }
}

TEST(JobFiles, OnlyTheNewestAreKeptWithinTheirBounds) {
  const auto file = [](storage::JobId job, std::int64_t at_s, std::uint64_t bytes) {
    return storage::JobFile{job, at_s, "csv", fmt::format("job-{}", job), bytes};
  };
  constexpr std::int64_t kNow_s = 2'000'000'000, kWeek_s = 7 * 86'400;
  const auto jobs = [](const std::vector<storage::JobFile>& files) {
    std::vector<storage::JobId> ids;
    for (const storage::JobFile& each : files) ids.push_back(each.job);
    return ids;
  };
  EXPECT_THAT(jobs(storage::files_to_keep(
                  {file(1, kNow_s - kWeek_s - 1, 1), file(3, kNow_s, 1), file(2, kNow_s - kWeek_s, 1)}, kNow_s)),
              ElementsAre(3, 2));
  EXPECT_THAT(jobs(storage::files_to_keep(
                  {file(1, kNow_s, 1), file(2, kNow_s, storage::kMaxJobFileBytes - 9), file(3, kNow_s, 10)}, kNow_s)),
              ElementsAre(3));
  std::vector<storage::JobFile> many;
  for (int job = 1; job <= 60; ++job) many.push_back(file(job, kNow_s, 1));
  EXPECT_EQ(storage::files_to_keep(many, kNow_s).size(), storage::kMaxJobFiles);
  EXPECT_EQ(storage::files_to_keep(many, kNow_s).back().job, 11);
}

class JobFilesTest : public ApiTest {
 protected:
  template <class T>
  T wait(boost::asio::awaitable<T> asked) {
    std::optional<T> got;
    const auto take = [&]() -> boost::asio::awaitable<void> { got = co_await std::move(asked); };
    tasks.spawn("test", take());
    EXPECT_TRUE(clock.run_until([&] { return got.has_value(); }, 5s));
    return std::move(*got);
  }
  bool opened() {
    const auto open = [&]() -> boost::asio::awaitable<bool> {
      co_await recording.job_files.open();
      co_return true;
    };
    return wait(open());
  }
  std::size_t files() const {
    const auto path = recording.job_files.folder();
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator{path}, std::filesystem::directory_iterator{}));
  }
};

TEST_F(JobFilesTest, AStartRemovesDraftsAndFilesOfJobsThatAreNotDone) {
  const auto draft = wait(recording.job_files.begin_draft(5));
  std::ofstream{draft} << "whole";
  const auto file = wait(recording.job_files.finish(5, "csv"));
  ASSERT_TRUE(file) << file.error().detail;
  EXPECT_EQ(file->size_bytes, 5U);
  EXPECT_FALSE(std::filesystem::exists(draft));
  ASSERT_TRUE(wait(recording.job_files.find(5)));
  std::ofstream{recording.job_files.folder() / "job-6.part"} << "half";
  std::ofstream{recording.job_files.folder() / "job-6.part-journal"} << "half";
  EXPECT_EQ(files(), 3U);
  EXPECT_TRUE(opened());
  EXPECT_EQ(files(), 0U) << "nobody knows a job 5";
}

}  // namespace
}  // namespace server
