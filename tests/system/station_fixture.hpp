// A whole station with its recorder, and a simulated robot, in one process and in virtual time.
//
// Tests are told in the words of tests/sim_robot/story_words.hpp. Here "accepted" is what the station makes of it
// (acknowledged), a refusal may be its own, and a link that is not connected counts as lost.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "server/runtime/tasks.hpp"
#include "server/station/models/model_sender.hpp"
#include "server/storage/recording_parts.hpp"
#include "tests/sim_robot/story_words.hpp"
#include "tests/system/virtual_robot.hpp"

namespace server {

using namespace std::chrono_literals;

class SystemTest : public ::testing::Test, public sim_robot::StoryWords {
 public:
  SystemTest();
  ~SystemTest() override;

 protected:
  // Runs a coroutine to its end, in virtual time, and gives its result.
  template <class T>
  T wait_for(boost::asio::awaitable<T> coroutine, microseconds limit = 10s) {
    std::optional<T> result;
    tasks.spawn("test", keep_result(std::move(coroutine), result));
    EXPECT_TRUE(clock.run_until([&] { return result.has_value(); }, limit));
    return std::move(result).value();
  }

  void begin(sim_robot::SimulatedRobotConfig config = {});  // it dials, and its first sample is heard
  const station::RobotState& state() const { return *station.find("sim-1"); }
  storage::RunId begin_run();
  std::vector<storage::StoredSample> samples_of(storage::RunId run);
  // Ends the run: nothing of it is lost.
  void expect_whole(storage::RunId run);

  sim_robot::Moment moment() const override;

 private:
  class Listener final : public station::StationSink {
   public:
    explicit Listener(SystemTest& test) : test_{test} {}
    void on_robot(const station::RobotState& state) override;
    void on_event(const station::RobotState& state, const station::RobotEvent& event) override;

    int connections = 0;

   private:
    SystemTest& test_;
    std::int64_t connected_at_us_ = 0;
    std::set<std::pair<station::BootId, std::uint64_t>> known_events_;  // one may come twice after a reconnect
  };

  void step() override { clock.run_for(10ms); }
  std::uint64_t give(const protocol::Command& command) override;
  std::optional<sim_robot::Answer> answer_to(std::uint64_t command_id) const override;
  boost::asio::awaitable<void> submit(std::uint64_t id, protocol::Command action);
  sim_robot::View received() const;

  template <class T>
  static boost::asio::awaitable<void> keep_result(boost::asio::awaitable<T> coroutine, std::optional<T>& result) {
    result.emplace(co_await std::move(coroutine));
  }

 protected:
  std::filesystem::path folder;
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  runtime::WorkerThread disk{"disk"}, readers{"readers"}, exports{"exports"}, checkpoints{"checkpoints"};
  runtime::TaskGroup tasks{loop};
  Listener listener_of_events{*this};
  station::Station station{loop, clock, config::Envelope{}, config::LinkTimes{}};
  std::unique_ptr<storage::RecordingParts> recording;
  std::unique_ptr<station::ModelSender> models;
  storage::Recorder* recorder = nullptr;  // of recording, as are the next two
  storage::Runs* runs = nullptr;
  storage::History* history = nullptr;
  net::PortAccess entrance{{clock, "robot port", net::ConnectionLimits{}}, nullptr};
  std::unique_ptr<link::RobotListener> listener;
  std::unique_ptr<VirtualRobot> robot;

 private:
  std::uint64_t commands_given_ = 0;
  std::map<std::uint64_t, sim_robot::Answer> answers_;
};

}  // namespace server
