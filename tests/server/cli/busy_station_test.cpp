// Tools that wait for a station whose places are all taken: each asks again, and each wait ends.
#include <gmock/gmock.h>
#include <unistd.h>

#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <csignal>
#include <mutex>
#include <thread>

#include "server/cli/accounts/job.hpp"
#include "server/cli/accounts/station_client.hpp"
#include "server/cli/experiments/station_work.hpp"
#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

const StationAnswer kBusy{503, {{"reason", "busy"}, {"detail", "all connections of the station are taken"}}, ""};
constexpr BusyRule kShort{.pause = 1ms, .longest = 20ms};

// Gives these answers in turn, each to a connection of its own; the last one again and again.
class ScriptedStation {
 public:
  // Before the answer to request `interrupted_at` the test's process gets an interrupt, as by Ctrl-C.
  ScriptedStation(const std::filesystem::path& data_dir, std::vector<StationAnswer> answers,
                  std::size_t interrupted_at = SIZE_MAX)
      : answers_{std::move(answers)}, interrupted_at_{interrupted_at} {
    std::filesystem::create_directories(data_dir);
    std::ofstream{data_dir / "rheonaut.token"} << "secret\n";
    const std::string address = "127.0.0.1:" + std::to_string(acceptor_.local_endpoint().port());
    std::ofstream{data_dir / "endpoints.json"} << json{{"http", address}};
    thread_ = std::thread{[this] { serve(); }};
  }
  ~ScriptedStation() {
    is_over_ = true;
    {
      asio::io_context loop;
      tcp::socket last{loop};  // ends the wait for a connection, and then that for a request
      last.connect(acceptor_.local_endpoint());
    }
    thread_.join();
  }
  ScriptedStation(const ScriptedStation&) = delete;
  ScriptedStation& operator=(const ScriptedStation&) = delete;

  std::vector<std::string> asked() {
    const std::lock_guard lock{mutex_};
    return asked_;
  }

 private:
  void serve() {
    for (std::size_t next = 0; !is_over_; next = std::min(next + 1, answers_.size() - 1)) {
      tcp::socket socket = acceptor_.accept();
      std::string request;
      boost::system::error_code gone;
      asio::read_until(socket, asio::dynamic_buffer(request), "\r\n\r\n", gone);
      if (gone) return;
      {
        const std::lock_guard lock{mutex_};
        asked_.push_back(request.substr(0, request.find(" HTTP")));
      }
      if (next == interrupted_at_) ::kill(::getpid(), SIGINT);
      const std::string body = answers_[next].body.dump();
      const std::string head =
          "HTTP/1.1 " + std::to_string(answers_[next].status) +
          " Answer\r\nContent-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) +
          "\r\nConnection: close\r\n\r\n";
      asio::write(socket, asio::buffer(head + body), gone);
    }
  }

  std::vector<StationAnswer> answers_;
  std::size_t interrupted_at_;
  asio::io_context loop_;
  tcp::acceptor acceptor_{loop_, {asio::ip::address_v4::loopback(), 0}};
  std::atomic<bool> is_over_ = false;
  std::mutex mutex_;
  std::vector<std::string> asked_;
  std::thread thread_;
};

template <class Act>
std::string error_of(const Act& act) {
  try {
    act();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

StationAnswer job(const char* state) {
  const bool is_done = std::string{state} == "done";
  return {200,
          {{"job_id", 1},
           {"state", state},
           {"ended_at_us", is_done ? json(1) : json()},
           {"progress", nullptr},
           {"error", nullptr},
           {"result", {{"found", 7}}}},
          ""};
}

StationAnswer experiment(const char* state) {
  const bool has_ended = std::string{state} == "done" || std::string{state} == "aborted";
  return {200,
          {{"experiment_id", 1},
           {"robot_id", "r"},
           {"name", "x"},
           {"state", state},
           {"stamp_us", 5},
           {"reason", nullptr},
           {"detail", nullptr},
           {"activity", nullptr},
           {"progress", nullptr},
           {"waits_for", nullptr},
           {"runs", json::array()},
           {"ended_at_us", has_ended ? json(1) : json()}},
          ""};
}

using BusyStationTest = ToolTest;

TEST_F(BusyStationTest, AWaitEndsWhenEveryAnswerOfItsTimeWasBusy) {
  BusyWait busy{kShort};
  int asked = 0;
  const std::string error = error_of([&] {
    while (busy.asks_again(kBusy)) ++asked;
  });
  EXPECT_GT(asked, 0);
  EXPECT_THAT(error, HasSubstr("the station has been busy for 0 s: all its connections are taken"));
  EXPECT_THAT(error_of([] {
                BusyWait a_minute{{.pause = 0ms}};
                a_minute.asks_again(kBusy);
              }),
              "");
}

TEST_F(BusyStationTest, AnotherAnswerBeginsTheTimeAnew) {
  BusyWait busy{{.pause = 400ms, .longest = 1s}};
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(busy.asks_again(job("running")));
    EXPECT_TRUE(busy.asks_again(kBusy));
  }
}

TEST_F(BusyStationTest, JobsAndExperimentsOfToolsAreNotWaitedForWithoutEnd) {
  const auto ask = [](const std::string&, const std::string&, const json&) { return kBusy; };
  const StationWork work{ask, [](const json&) { FAIL(); }, kShort};
  EXPECT_THAT(error_of([&] { work.finished_job(1); }),
              AllOf(HasSubstr("the station has been busy"), HasSubstr("rheonaut job show 1 --wait")));
  EXPECT_THAT(error_of([&] { work.finished_experiment(1); }),
              AllOf(HasSubstr("the station has been busy"), HasSubstr("rheonaut experiment show 1")));
}

TEST_F(BusyStationTest, AJobThatIsWaitedForIsAskedForAgain) {
  ScriptedStation station{folder_ / "data", {job("running"), kBusy, job("done")}};
  const Answer answer = ask("job show 1 --wait --data @data");
  EXPECT_EQ(answer.exit_code, 0) << answer.error;
  EXPECT_EQ(answer.json()["found"], 7);
  EXPECT_EQ(station.asked().size(), 3U);
}

// What goes on is named, so that who began it by this command finds it again.
TEST_F(BusyStationTest, AJobThatIsWaitedForEndsInAnErrorThatNamesIt) {
  const ScriptedStation station{folder_ / "data", {job("waiting"), job("running"), kBusy}};
  std::ofstream{folder_ / "job.json"} << "{}";
  JobCommand command;
  command.act = JobCommand::Act::begin;
  command.data_dir = folder_ / "data";
  command.file = folder_ / "job.json";
  command.waits = true;
  command.busy = kShort;
  std::ostringstream out;
  EXPECT_THAT(error_of([&] { run(command, out); }),
              AllOf(HasSubstr("the station has been busy for 0 s"),
                    HasSubstr("job 1 goes on without this command; rheonaut job show 1 --wait --data '" +
                              (folder_ / "data").string() + "' waits for it")));
  EXPECT_EQ(out.str(), "");
}

TEST_F(BusyStationTest, AJobWhoseStationIsGoneIsNamed) {
  std::filesystem::create_directories(folder_ / "data");
  std::ofstream{folder_ / "data" / "rheonaut.token"} << "secret\n";
  std::ofstream{folder_ / "data" / "endpoints.json"} << json{{"http", "127.0.0.1:1"}};
  EXPECT_THAT(ask("job show 1 --wait --data @data").error,
              AllOf(HasSubstr("does not answer"), HasSubstr("rheonaut job show 1 --wait --data"),
                    Not(HasSubstr("goes on without"))));
}

// A sign of life that gave way is followed by the next one; the end, too, is asked for again.
TEST_F(BusyStationTest, AnExperimentThatIsWaitedForGoesOn) {
  ScriptedStation station{folder_ / "data",
                          {experiment("waiting"), kBusy, experiment("running"), kBusy, experiment("done"), kBusy,
                           experiment("done"), experiment("done")}};
  const Answer answer = ask("experiment resume 1 --wait --data @data");
  EXPECT_EQ(answer.exit_code, 0) << answer.error;
  const std::string alive = "POST /api/v1/experiments/1/keep-alive", look = "GET /api/v1/experiments/1";
  EXPECT_THAT(station.asked(),
              ElementsAre("POST /api/v1/experiments/1/resume", alive, alive, alive, alive, look, look));
}

// SAFETY: an abort that found no place is not lost.
TEST_F(BusyStationTest, AnInterruptIsSentAgainUntilTheStationHasIt) {
  ScriptedStation station{folder_ / "data",
                          {experiment("waiting"), experiment("running"), kBusy, experiment("running"),
                           experiment("running"), experiment("aborted")},
                          1};
  const Answer answer = ask("experiment resume 1 --wait --data @data");
  EXPECT_EQ(answer.exit_code, 5) << answer.error;
  const std::string one = "/api/v1/experiments/1";
  EXPECT_THAT(station.asked(),
              ElementsAre("POST " + one + "/resume", "POST " + one + "/keep-alive", "POST " + one + "/abort",
                          "GET " + one, "POST " + one + "/abort", "GET " + one));
}

}  // namespace
}  // namespace server::cli
