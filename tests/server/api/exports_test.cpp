// Exports over the routes: what they are called, what they refuse, and that they leave nothing behind.
#include <algorithm>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

class ExportsTest : public ApiTest {
 protected:
  void make_run() {
    connect_robot();
    ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "run"}});
    for (std::uint64_t seq = 0; seq < 500; seq += 25) make_samples(*robot, seq, 25);
  }
  static std::string header(const Answered& answered, const std::string& name) {
    for (const auto& [key, value] : answered.response.headers) {
      if (key == name) return value;
    }
    return {};
  }
  std::ptrdiff_t left_behind() {
    clock.settle();
    if (!std::filesystem::exists(recording.exports_folder())) return 0;
    return std::distance(std::filesystem::directory_iterator{recording.exports_folder()}, {});
  }
};

TEST_F(ExportsTest, EachFormatIsAnAttachmentWithItsName) {
  make_run();
  const std::pair<const char*, const char*> beginnings[] = {
      {".csv", "span,boot_id,seq"}, {".mat", "MATLAB 5.0 MAT-file"}, {".sqlite", "SQLite format 3"}};
  for (const auto& [ending, beginning] : beginnings) {
    SCOPED_TRACE(ending);
    {
      const Answered answered = ask("GET", std::string{"/api/v1/runs/1/samples"} + ending);
      EXPECT_EQ(answered.status, 200) << answered.body;
      EXPECT_TRUE(answered.body.starts_with(beginning)) << answered.body.substr(0, 40);
      EXPECT_EQ(header(answered, "Content-Disposition"), std::string{"attachment; filename=\"run-1"} + ending + "\"");
    }
    EXPECT_EQ(left_behind(), 0);
  }
}

TEST_F(ExportsTest, ChannelsAndAGridAreChosenByTheQuery) {
  make_run();
  const std::string csv = ask("GET", "/api/v1/runs/1/samples.csv?channels=duty&grid_us=100000").body;
  EXPECT_TRUE(csv.starts_with("span,t_s,utc,duty,setpoint_m,mode,gap\n0,0.000000,"));
  EXPECT_LT(std::ranges::count(csv, '\n'), 20);  // of 500 samples at 100 Hz, some at the same time
  EXPECT_LT(ask("GET", "/api/v1/runs/1/samples.mat?channels=duty").body.size(),
            ask("GET", "/api/v1/runs/1/samples.mat").body.size());
}

TEST_F(ExportsTest, WhatIsWrongIsRefusedBeforeAnythingIsSent) {
  make_run();
  EXPECT_EQ(ask("GET", "/api/v1/runs/9/samples.csv").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/runs/9/samples.mat").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/runs/9/samples.sqlite").status, 404);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/samples.csv?grid_us=99").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/samples.mat?channels=volume").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/runs/1/samples.sqlite?grid_us=1000").status, 400);
  EXPECT_EQ(left_behind(), 0);
}

// To remove a file of gigabytes takes long: it is not done on the loop, but by the exports' worker.
TEST_F(ExportsTest, TheFileIsRemovedByTheWorker) {
  make_run();
  ask("GET", "/api/v1/runs/1/samples.mat");
  clock.settle();
  {
    const Answered answered = ask("GET", "/api/v1/runs/1/samples.mat");
    EXPECT_EQ(exports.jobs(), 0);
  }
  EXPECT_FALSE(std::filesystem::is_empty(recording.exports_folder()));
  EXPECT_EQ(left_behind(), 0);
}

// A page is answered while an export's worker is busy.
TEST_F(ExportsTest, AnExportDoesNotUseTheReadersThread) {
  make_run();
  const std::uint64_t before = recording.history.reader().questions();
  ask("GET", "/api/v1/runs/1/samples.mat");
  ask("GET", "/api/v1/runs/1/samples.csv");
  EXPECT_EQ(recording.history.reader().questions(), before);
  EXPECT_GT(recording.exports.reader().questions(), 4u);
}

}  // namespace
}  // namespace server
