// What a station gives of the recorded database: pages of JSON, exports in every format, digests, figures.
#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>

#include "server/storage/runs/run_digest.hpp"
#include "tests/goldens/answers.hpp"
#include "tests/goldens/database_text.hpp"
#include "tests/goldens/golden_file.hpp"
#include "tests/goldens/golden_station.hpp"
#include "tests/server/recording/schema_dump.hpp"

namespace server {
namespace {

// The file of a target's answer: "/api/v1/runs/3?limit=1" is "runs_3_limit=1".
std::string file_of(std::string target) {
  target.erase(0, std::string{"/api/v1/"}.size());
  for (char& c : target) {
    if (c == '/' || c == '?' || c == '&') c = '_';
  }
  return target;
}

class GoldenAnswers : public ::testing::Test {
 protected:
  GoldenAnswers() {
    make_database_of_text(folder_.path() / "recorded.sqlite", content_of(golden_path("database.sql")));
    station_.emplace(folder_.path() / "recorded.sqlite");
    station_->step_utc(kStoryAfter + 2h);
    station_->pass(6s);
  }

  void expect_answer(const std::string& target) {
    expect_golden("stored/" + file_of(target) + ".txt", answer_text(target, station_->ask("GET", target)));
  }
  // The head apart from the file, which is then as a person gets it.
  Answered exported(const std::string& target) {
    Answered answered = station_->ask("GET", target);
    std::string body = std::exchange(answered.body, "");
    expect_golden("exports/" + file_of(target) + ".head.txt", answer_text(target, answered));
    answered.body = std::move(body);
    return answered;
  }
  std::string as_sql(const std::string& file) {
    const auto path = folder_.path() / "exported.sqlite";
    std::ofstream{path, std::ios::binary} << file;
    return database_text(path);
  }

  TemporaryFolder folder_;
  std::optional<GoldenStation> station_;
};

TEST_F(GoldenAnswers, Pages) {
  for (const char* target :
       {"/api/v1/robots", "/api/v1/robots/r1", "/api/v1/robots/nobody", "/api/v1/fluids", "/api/v1/users",
        "/api/v1/tokens", "/api/v1/sessions", "/api/v1/enrolments", "/api/v1/me", "/api/v1/runs",
        "/api/v1/runs?state=discarded", "/api/v1/runs?robot_id=r1&limit=1", "/api/v1/runs/3", "/api/v1/runs/99",
        "/api/v1/audit?limit=25", "/api/v1/audit?limit=2&action=run"}) {
    expect_answer(target);
  }
}

TEST_F(GoldenAnswers, PagesOfTheStation) {
  for (const char* target : {"/api/v1/station", "/api/v1/recording", "/api/v1/backups"}) {
    const std::string text = answer_text(target, station_->ask("GET", target));
    expect_golden("stored/" + file_of(target) + ".txt", without_port_and_sizes(text));
  }
}

TEST_F(GoldenAnswers, PagesOfARobot) {
  for (const char* robot : {"r1", "r2", "nemo"}) {
    for (const char* of : {"commands", "events", "gaps", "markers", "parameters", "controller"}) {
      expect_answer(fmt::format("/api/v1/robots/{}/{}", robot, of));
    }
  }
  expect_answer("/api/v1/robots/r1/events?limit=2");
  expect_answer("/api/v1/robots/r1/samples?limit=8");
  expect_answer("/api/v1/robots/r1/samples?limit=0");
  expect_answer("/api/v1/robots/r1/overview?points=7");
}

TEST_F(GoldenAnswers, PagesOfARun) {
  for (const int run : {1, 2, 3, 4, 6, 7}) {
    for (const char* of : {"certificate", "markers", "gaps", "reference", "step-metrics"}) {
      expect_answer(fmt::format("/api/v1/runs/{}/{}", run, of));
    }
  }
  for (const int run : {1, 3}) expect_answer(fmt::format("/api/v1/runs/{}/snapshot", run));
  expect_answer("/api/v1/runs/3/samples?after=0-12&limit=3");
  expect_answer("/api/v1/runs/3/samples?after=0-54&limit=20");
  expect_answer("/api/v1/runs/3/gaps?limit=1");
  expect_answer("/api/v1/runs/3/reference/positions");
  expect_answer("/api/v1/runs/3/overview?points=9&channels=position_m,duty");
}

TEST_F(GoldenAnswers, ExportsAsCsv) {
  for (const char* target : {"/api/v1/runs/3/samples.csv", "/api/v1/runs/3/samples.csv?grid_us=100000",
                             "/api/v1/runs/4/samples.csv?channels=duty,position_m", "/api/v1/runs/6/samples.csv"}) {
    expect_golden("exports/" + file_of(target) + ".csv", exported(target).body);
  }
}

TEST_F(GoldenAnswers, ExportsAsMat) {
  for (const char* target : {"/api/v1/runs/3/samples.mat", "/api/v1/runs/3/samples.mat?grid_us=100000"}) {
    expect_golden("exports/" + file_of(target) + ".mat", without_date(exported(target).body));
  }
}

TEST_F(GoldenAnswers, ExportsAsSqlite) {
  expect_golden("exports/runs_3_samples.sqlite.sql", as_sql(exported("/api/v1/runs/3/samples.sqlite").body));
}

TEST_F(GoldenAnswers, Metrics) { expect_golden("metrics.txt", without_values(station_->ask("GET", "/metrics").body)); }

// Computed anew over the stored samples, in both formats whatever the run's own is.
TEST_F(GoldenAnswers, Digests) {
  SQLite::Database database{(folder_.path() / "recorded.sqlite").string(), SQLite::OPEN_READONLY};
  std::string text;
  for (const storage::RunId run : {1, 2, 3, 4, 6, 7}) {
    for (const int format : {1, 2}) {
      storage::DigestComputation computation{storage::read_digest_spans(database, run), format};
      while (computation.advance(database, 50) == storage::DigestComputation::Progress::more) continue;
      const storage::RunDigest made = computation.digest();
      text += fmt::format("run {} format {}: {} live, {} sent again, {} lost, {}\n", run, format, made.samples_live,
                          made.samples_backfilled, made.samples_lost, made.sha256);
    }
  }
  expect_golden("digests.txt", text);
}

}  // namespace
}  // namespace server
