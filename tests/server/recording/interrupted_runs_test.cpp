// What the station's log says of runs that were open when it stopped.
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <sstream>
#include <utility>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class Log {
 public:
  Log() {
    auto sink = std::make_shared<spdlog::sinks::ostream_sink_mt>(text_);
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", std::move(sink)));
  }
  ~Log() { spdlog::set_default_logger(before_); }
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;

  // The lines with these words, since the last call.
  std::vector<std::string> lines_with(const std::string& words) {
    std::vector<std::string> lines;
    std::istringstream said{std::exchange(text_, std::ostringstream{}).str()};
    for (std::string line; std::getline(said, line);) {
      if (const auto at = line.find(words); at != std::string::npos) lines.push_back(line.substr(line.find("run ")));
    }
    return lines;
  }

 private:
  std::ostringstream text_;
  std::shared_ptr<spdlog::logger> before_ = spdlog::default_logger();
};

class InterruptedRunsTest : public RecordingTest {
 protected:
  TestRobot robot_;

  void create(const std::string& name) {
    storage::RunConditions conditions;
    conditions.name = name;
    EXPECT_TRUE(wait(runs_->create(robot_.id, std::move(conditions))));
  }
};

TEST_F(InterruptedRunsTest, TheLogNamesEachRunThatAStopOrAKillHasInterruptedOnce) {
  Log log;
  start();
  connect(robot_);
  create("step 1");
  station::SampleBatch batch = robot_.batch(0, 100);
  batch.utc_offset_us = 1'750'000'000'000'000;  // 2025-06-15 15:06:40
  send(robot_, batch);
  robot_.next_seq = 100;
  flush();
  EXPECT_TRUE(log.lines_with("interrupted").empty());
  kill();
  start();
  const auto by_kill = log.lines_with("interrupted");
  ASSERT_EQ(by_kill.size(), 1U);
  EXPECT_TRUE(
      by_kill[0].starts_with("run 1 'step 1' of robot 'nemo' was open when the station stopped: it is "
                             "interrupted at its last sample, 2025-06-15 15:0"))
      << by_kill[0];
  connect(robot_);
  create("the next one");
  stop();
  start();
  const auto by_stop = log.lines_with("interrupted");
  ASSERT_EQ(by_stop.size(), 1U) << "not the first one again";
  EXPECT_EQ(by_stop[0],
            "run 2 'the next one' of robot 'nemo' was open when the station stopped: it is interrupted "
            "without a sample");
  stop();
  start();
  EXPECT_TRUE(log.lines_with("interrupted").empty());
}

}  // namespace
}  // namespace server
