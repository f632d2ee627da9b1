// A robot whose runs the command line tools read: what it does is simulated, recorded, and may be exported.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>
#include <utility>

#include "control/models/modal_plant.hpp"
#include "server/storage/query/run_reader.hpp"
#include "tests/server/cli/tool_test.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {

class RunTools : public RecordingTest {
 protected:
  cli::ToolAnswer ask(const std::string& command) { return cli::ask_tool(folder_, command + " --data @."); }

  // The robot swims for this many samples under this duty, and the station records it.
  void swim(std::size_t count, double duty) {
    station::SampleBatch batch = robot_.batch(robot_.next_seq, count);
    for (station::Sample& sample : batch.samples) {
      sample.position_m = static_cast<float>(plant_.position_m()) + robot_.context.disturbance_m.value_or(0);
      sample.velocity_m_s = static_cast<float>(plant_.velocity_m_s());
      sample.duty = static_cast<float>(duty);
      plant_.step(duty);
    }
    if (lacks_a_velocity_) batch.samples.front().velocity_m_s = std::nanf("");
    send(robot_, batch);
    robot_.next_seq += count;
  }

  // The propeller turns, the robot does not move, and the sensor trembles.
  void tremble(std::size_t count) {
    station::SampleBatch batch = robot_.batch(robot_.next_seq, count);
    for (std::size_t k = 0; k < count; ++k) {
      batch.samples[k].position_m = 1e-3F * static_cast<float>(static_cast<int>(k * 7919 % 101) - 50);
      batch.samples[k].duty = 0.3F;
    }
    send(robot_, batch);
    robot_.next_seq += count;
  }

  // As swim(), on an accelerometer whose readings the robot's filter has taken its bias off.
  void swim_on_the_accelerometer(std::size_t count, double duty) {
    station::SampleBatch batch = robot_.batch(robot_.next_seq, count);
    for (station::Sample& sample : batch.samples) {
      const double reading_m_s2 = 0.01 * std::round((plant_.acceleration_m_s2() + noise_(random_)) / 0.01);
      sample.acceleration_m_s2 = static_cast<float>(reading_m_s2 - 0.0031);
      sample.position_m = static_cast<float>(0.5 * plant_.position_m());  // as a robot of another fluid believes
      sample.velocity_m_s = static_cast<float>(0.5 * plant_.velocity_m_s());
      sample.duty = static_cast<float>(duty);
      plant_.step(duty);
    }
    if (lacks_a_velocity_) batch.samples.front().position_m = batch.samples.front().velocity_m_s = std::nanf("");
    send(robot_, batch);
    robot_.next_seq += count;
  }

  // What an export has of the columns that matter here. Without the last, it is no robot's record.
  void write_csv(storage::RunId run, bool with_sd = true) {
    const auto samples = storage::read_run(path_, run, 10000);
    ASSERT_TRUE(samples) << samples.error().detail;
    std::ofstream out{folder_ / "run.csv"};
    out << "robot_time_us,position_m,velocity_m_s,acceleration_m_s2,duty,disturbance_m";
    out << (with_sd ? ",position_sd_m\n" : "\n");
    for (const storage::StoredSample& stored : *samples) {
      const station::Sample& s = stored.sample;
      const auto cell = [](float value) { return std::isfinite(value) ? fmt::format("{}", value) : std::string{}; };
      out << fmt::format("{},{},{},{},{},{}", stored.robot_time_us, cell(s.position_m), cell(s.velocity_m_s),
                         s.acceleration_m_s2, s.duty, station::or_nan(stored.disturbance_m));
      out << (with_sd ? "," + cell(station::or_nan(stored.position_sd_m)) : "") << '\n';
    }
  }

  // Both without the text that differs.
  std::pair<nlohmann::json, nlohmann::json> from_run_and_csv(storage::RunId run) {
    write_csv(run);
    const cli::ToolAnswer of_run = ask("identify --run 1 --structure second_order --json");
    const cli::ToolAnswer of_csv = cli::ask_tool(folder_, "identify --csv @run.csv --structure second_order --json");
    EXPECT_EQ(of_run.exit_code, 0) << of_run.error;
    EXPECT_EQ(of_csv.exit_code, 0) << of_csv.error;
    return {of_run.json(), of_csv.json()};
  }

  storage::RunId begin() {
    start();
    connect(robot_);
    return wait(runs_->create(robot_.id, named("duty step"))).value().id;
  }

  TestRobot robot_;
  bool lacks_a_velocity_ = false;  // the first of each batch; on the accelerometer, a position too
  control::ModalPlant plant_{control::kNonNewtonianModel, 0.01};
  std::mt19937 random_{11};
  std::normal_distribution<double> noise_{0, 0.012};
};

}  // namespace server
