// A whole station with its recorder, and a simulated robot, in one process and in virtual time.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>

#include "server/recording/recording_parts.hpp"
#include "server/tasks.hpp"
#include "tests/system/virtual_robot.hpp"

namespace server {

using namespace std::chrono_literals;

class SystemTest : public ::testing::Test {
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

  CommandRecord command(protocol::Command action);
  CommandRecord refused_command(protocol::Command action);  // reached the robot, or was refused before
  CommandRecord stop();
  static protocol::Command set_auto(float setpoint_m);
  static protocol::Command set_duty(float duty);
  static protocol::Command inject_disturbance(float disturbance_m);
  static protocol::Command clear_emergency(std::uint64_t emergency_id);

  void add_robot(sim_robot::SimulatedRobotConfig config = {});  // dials, and waits for its first sample
  const RobotState& state() const { return *station.find("sim-1"); }
  RunId begin_run();
  std::vector<StoredSample> samples_of(RunId run);

 private:
  template <class T>
  static boost::asio::awaitable<void> keep_result(boost::asio::awaitable<T> coroutine, std::optional<T>& result) {
    result.emplace(co_await std::move(coroutine));
  }

 protected:
  std::filesystem::path folder;
  boost::asio::io_context loop;
  VirtualClock clock{loop};
  WorkerThread disk{"disk"}, readers{"readers"};
  TaskGroup tasks{loop};
  Station station{loop, clock, CommandLimits{}, LinkTimes{}};
  std::unique_ptr<RecordingParts> recording;
  Recorder* recorder = nullptr;  // of recording, as are the next two
  Runs* runs = nullptr;
  History* history = nullptr;
  std::unique_ptr<RobotListener> listener;
  std::unique_ptr<VirtualRobot> robot;
};

}  // namespace server
