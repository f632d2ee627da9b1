// A position from outside, from the command line without a station: imported, shown, fitted, taken away.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cmath>
#include <random>

#include "control/models/modal_plant.hpp"
#include "tests/server/cli/tool_test.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using cli::ToolAnswer;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// A robot that believes it swims half as far as it does, and a camera at 30 Hz that sees it.
class ReferenceTools : public RecordingTest {
 protected:
  explicit ReferenceTools(bool has_second_step = false) {
    start();
    connect(robot_);
    robot_.context.position_sd_m = 0.004F;
    const storage::RunId run = wait(runs_->create(robot_.id, named("swim"))).value().id;
    for (const double duty : {0.0, 0.4, -0.5, 0.6, -0.6, 0.3}) swim(100, duty);
    robot_.context.mode = rheonaut_MODE_AUTO;
    robot_.context.setpoint_m = 0.2F;
    for (const double duty : {-0.3, 0.5, -0.4}) swim(100, duty);
    if (has_second_step) {
      robot_.context.position_sd_m = 0.05F;
      robot_.context.setpoint_m = 0.1F;
      swim(100, 0.2);
    }
    wait(runs_->end(run, ""));
    stop();
    camera(-3.4567);
  }

  ToolAnswer ask(const std::string& command) { return cli::ask_tool(folder_, command + " --data @."); }

  void swim(std::size_t count, double duty) {
    station::SampleBatch batch = robot_.batch(robot_.next_seq, count);
    for (station::Sample& sample : batch.samples) {
      truth_m_.push_back(plant_.position_m());
      sample.position_m = static_cast<float>(0.5 * plant_.position_m());
      sample.acceleration_m_s2 =
          static_cast<float>(0.01 * std::round(100 * (plant_.acceleration_m_s2() + noise_(random_))));
      sample.duty = static_cast<float>(duty);
      plant_.step(duty);
    }
    send(robot_, batch);
    robot_.next_seq += count;
  }

  // Its times plus clock_s are those of the run.
  void camera(double clock_s, double to_s = 8.9) {
    std::ofstream out{folder_ / "camera.csv"};
    out << "t_s,position_m\n";
    for (double at_s = 0.02; at_s < to_s; at_s += 1.0 / 30) {
      const auto k = static_cast<std::size_t>(at_s / 0.01);
      const double seen_m = std::lerp(truth_m_[k], truth_m_[k + 1], at_s / 0.01 - static_cast<double>(k));
      out << fmt::format("{:.6f},{:.6f}\n", at_s - clock_s, 1.25 + seen_m + 0.04 * noise_(random_));
    }
  }

  TestRobot robot_;
  control::ModalPlant plant_{control::kNonNewtonianModel, 0.01};
  std::vector<double> truth_m_;
  std::mt19937 random_{11};
  std::normal_distribution<double> noise_{0, 0.012};
};

TEST_F(ReferenceTools, ImportFindsTheClockAndIdentifyPrefersWhatWasMeasured) {
  const ToolAnswer made = ask("reference import --run 1 --csv @camera.csv --sd-mm 0.5");
  ASSERT_EQ(made.exit_code, 0) << made.error;
  EXPECT_THAT(made.text, AllOf(HasSubstr("positions of camera.csv"), HasSubstr("clock by correlation"),
                               HasSubstr("plus -3.45"), HasSubstr("zero by the robot's own record")));
  EXPECT_EQ(ask("reference show --run 1").text, made.text);
  const auto shown = ask("reference show --run 1 --json").json();
  EXPECT_EQ(shown["run_id"], 1);
  EXPECT_EQ(shown["source"], "camera.csv");
  EXPECT_EQ(shown["clock_method"], "correlation");

  const ToolAnswer fitted = ask("identify --run 1 --structure second_order");
  EXPECT_THAT(fitted.text,
              StartsWith("fitted: position_m; position measured from outside (camera.csv), 30 Hz, ± 1 mm, clock by "
                         "correlation"));
  EXPECT_THAT(fitted.text, HasSubstr("clock of the position from outside: "));
  const auto json = ask("identify --run 1 --structure second_order --json").json();
  EXPECT_NEAR(json["parameters"]["kp"].get<double>(), 0.1, 0.01);  // half of it by what the robot believes
  EXPECT_EQ(json["channels"], nlohmann::json{"position_m"});
  EXPECT_TRUE(json["position_clock_sigma_s"].is_number());
  EXPECT_THAT(ask("identify --run 1 --structure second_order --channels robot").text,
              StartsWith("fitted: acceleration_m_s2"));
}

TEST_F(ReferenceTools, PredictComparesWithWhatWasMeasured) {
  const ToolAnswer own = ask("predict --run 1");
  EXPECT_THAT(own.text, StartsWith("compared with: the robot's own estimate (position_sd_m is up to 0.004 m)\n"));
  const double own_step_m = ask("predict --run 1 --json").json()["experiment"]["setpoint_m"].get<double>();
  EXPECT_NEAR(own_step_m, 0.2 - 0.5 * truth_m_[600], 1e-6);
  ASSERT_EQ(ask("reference import --run 1 --csv @camera.csv --sd-mm 0.5 --offset-s -3.4567 --keep-zero").exit_code, 0);
  const ToolAnswer answer = ask("predict --run 1");
  EXPECT_THAT(answer.text, AllOf(StartsWith("compared with: position measured from outside (camera.csv), ± 1 mm\n"),
                                 HasSubstr(" to 0.2 m, measured from outside")));
  const auto json = ask("predict --run 1 --json").json();
  EXPECT_EQ(json["compared_with"], "position measured from outside (camera.csv), ± 1 mm");
  const auto& step = json["measured_steps"][0];
  EXPECT_EQ(step["position_source"], "outside");
  EXPECT_GT(step["estimate_error"]["samples"].get<int>(), 50);
  const double seen_m = 1.25 + truth_m_[600];
  EXPECT_NEAR(step["start_m"].get<double>(), seen_m, 0.005);
  EXPECT_NEAR(json["experiment"]["setpoint_m"].get<double>(), 0.2 - seen_m, 0.005);
  EXPECT_THAT(ask("predict --run 1 --csv").text,
              HasSubstr(fmt::format("{}", json["reference_m"].back().get<double>())));
}

TEST_F(ReferenceTools, PredictSaysWhenTheReferenceMeasuredNoStep) {
  camera(-3.4567, 5);
  ASSERT_EQ(ask("reference import --run 1 --csv @camera.csv --sd-mm 0.5 --offset-s -3.4567").exit_code, 0);
  EXPECT_THAT(ask("predict --run 1").text,
              HasSubstr("; the position from outside has no step with 10 positions and no pause over 0.25 s\n"));
}

TEST_F(ReferenceTools, PredictSettlesInTheBandOfTheMeasuredStep) {
  ASSERT_EQ(ask("reference import --run 1 --csv @camera.csv --sd-mm 0.5 --offset-s -3.4567 --keep-zero").exit_code, 0);
  const auto json = ask("predict --run 1 --json").json();
  EXPECT_EQ(json["experiment"].value("settling_band_m", 0.0), json["measured_steps"][0]["band_m"]);
}

TEST_F(ReferenceTools, ImportReadsNoFifoAndNothingThatIsTooLong) {
  ASSERT_EQ(::mkfifo((folder_ / "fifo.csv").c_str(), 0600), 0);
  std::ofstream{folder_ / "long.csv"} << "t_s,position_m\n";
  std::filesystem::resize_file(folder_ / "long.csv", 50'000'000'000);  // a hole
  const std::string import = "reference import --run 1 --sd-mm 0.5 --csv ";
  EXPECT_THAT(ask(import + "@fifo.csv").error, HasSubstr("no file"));
  EXPECT_THAT(ask(import + "@.").error, HasSubstr("no file"));
  EXPECT_THAT(ask(import + "@long.csv").error, HasSubstr("has more than 16777216 bytes"));
}

TEST_F(ReferenceTools, ASourceWithControlCharactersIsShownInOneLine) {
  ASSERT_EQ(ask("reference import --run 1 --csv @camera.csv --sd-mm 0.5 --offset-s -3.4567").exit_code, 0);
  SQLite::Database{(folder_ / "station.sqlite").string(), SQLite::OPEN_READWRITE}.exec(
      "UPDATE outside_reference SET source = 'a' || char(27, 10) || 'b'");
  for (const char* act : {"show", "export"}) {
    EXPECT_THAT(ask(fmt::format("reference {} --run 1", act)).text, HasSubstr("a\\x1B\\x0Ab"));
  }
}

// The camera saw the first step only.
class TwoStepTools : public ReferenceTools {
 protected:
  TwoStepTools() : ReferenceTools(true) {}
};

TEST_F(TwoStepTools, PredictSaysOfBothSourcesHowExactTheyAre) {
  ASSERT_EQ(ask("reference import --run 1 --csv @camera.csv --sd-mm 0.5 --offset-s -3.4567 --keep-zero").exit_code, 0);
  EXPECT_THAT(ask("predict --run 1").text,
              StartsWith("compared with: position measured from outside (camera.csv), ± 1 mm, in 1 of 2 steps; in the "
                         "others the robot's own estimate (position_sd_m is up to 0.05 m)\n"));
}

// A hundred times what it should be.
TEST_F(ReferenceTools, PositionsThatLookLikeCentimetresNeedTheWordThatTheyAreNot) {
  std::ifstream in{folder_ / "camera.csv"};
  std::ofstream out{folder_ / "far.csv"};
  std::string line;
  std::getline(in, line);
  out << line << '\n';
  while (std::getline(in, line)) {
    const auto comma = line.find(',');
    out << fmt::format("{},{:.6f}\n", line.substr(0, comma), 100 * std::stod(line.substr(comma + 1)));
  }
  out.close();
  const std::string import = "reference import --run 1 --csv @far.csv --sd-mm 50 --offset-s -3.4567";
  EXPECT_THAT(ask(import).error, AllOf(HasSubstr("they look like centimetres"), HasSubstr("--metres")));
  EXPECT_EQ(ask(import + " --metres --json").json()["clock_offset_s"], -3.4567);
  const auto removed = ask("reference remove --run 1 --reason test --json").json();
  EXPECT_EQ(removed, nlohmann::json::parse(R"({"run_id":1,"reference":null})"));
}

TEST_F(ReferenceTools, AGivenClockIsTakenAtItsWord) {
  ASSERT_EQ(
      ask("reference import --run 1 --csv @camera.csv --sd-mm 0.5 --offset-s -3.4567 --clock-sd-s 0.01").exit_code, 0);
  EXPECT_THAT(ask("reference show --run 1").text, HasSubstr("clock by offset: its t_s plus -3.4567 s ± 20 ms"));
}

TEST_F(ReferenceTools, IdentifyWeighsEachPositionByItsOwnSdAndSaysWhatTheyCameTo) {
  std::ifstream in{folder_ / "camera.csv"};
  std::ofstream out{folder_ / "unequal.csv"};
  std::string line;
  std::getline(in, line);
  out << line << ",position_sd_m\n";
  for (int row = 0; std::getline(in, line); ++row) {
    if (row % 4 != 0) {
      out << line << ",0.0005\n";
      continue;
    }
    const auto comma = line.find(',');  // 20 mm off, and said to be
    out << fmt::format("{},{:.6f},0.02\n", line.substr(0, comma),
                       std::stod(line.substr(comma + 1)) + (row % 8 == 0 ? 0.02 : -0.02));
  }
  out.close();
  ASSERT_EQ(ask("reference import --run 1 --csv @unequal.csv --offset-s -3.4567").exit_code, 0);
  const std::string fit = "identify --run 1 --structure second_order";
  EXPECT_THAT(ask(fit).text, AllOf(HasSubstr("± 1 to 40 mm (each weighs by its own)"),
                                   HasSubstr("chi-square of the position from outside: ")));
  const auto json = ask(fit + " --json --residuals").json();
  EXPECT_NEAR(json["parameters"]["kp"].get<double>(), 0.1, 0.01);
  EXPECT_EQ(json["position_degrees_of_freedom"], 267 - 5);
  EXPECT_NEAR(json["position_chi_square"].get<double>(), 262, 80);
  EXPECT_NEAR(std::abs(json["residuals"]["position_m"][0].get<double>()), 0.02, 0.003) << "in metres, as measured";
}

// Positions that come late may show a dead time of the plant; positions that come early may not.
TEST_F(ReferenceTools, IdentifyDoubtsACameraClockThatCameOutOff) {
  const std::string import = "reference import --run 1 --csv @camera.csv --sd-mm 0.5 --reason again --offset-s ";
  const std::string fit = "identify --run 1 --structure first_order";
  const std::string of_clock = "the outside position's clock came out ", of_plant = "search for it (--dead-time-s)";
  ASSERT_EQ(ask(import + "-3.4067").exit_code, 0);
  EXPECT_THAT(ask(fit).text, AllOf(HasSubstr(of_clock + "-"), HasSubstr(of_plant)));
  EXPECT_THAT(ask(fit + " --channels robot").text, Not(HasSubstr(of_clock)));
  ASSERT_EQ(ask(import + "-3.5067").exit_code, 0);
  EXPECT_THAT(ask(fit).text,
              AllOf(HasSubstr(of_clock + "43 ms off: the positions come before the duty that moves the robot"),
                    Not(HasSubstr(of_plant))));
}

TEST_F(ReferenceTools, IsReplacedRemovedAndExported) {
  const std::string import = "reference import --run 1 --csv @camera.csv --sd-mm 0.5 --offset-s -3.4567";
  ASSERT_EQ(ask(import).exit_code, 0);
  EXPECT_THAT(ask(import).error, HasSubstr("give a reason to replace it"));
  EXPECT_EQ(ask(import + " --reason again").exit_code, 0);
  const std::string csv = ask("reference export --run 1").text;
  EXPECT_THAT(csv, StartsWith("# camera.csv of run 1, span 0\nrobot_time_us,position_m,position_sd_m\n"));
  EXPECT_EQ(std::ranges::count(csv, '\n'), 2 + 267);
  ASSERT_EQ(ask("export --run 1 --format sqlite --to @run.sqlite").exit_code, 0);
  SQLite::Database file{(folder_ / "run.sqlite").string()};
  EXPECT_EQ(file.execAndGet("SELECT count(*) FROM outside_position").getInt(), 267);
  EXPECT_EQ(file.execAndGet("SELECT source FROM outside_reference").getString(), "camera.csv");
  ASSERT_EQ(ask("reference remove --run 1 --reason wrong").exit_code, 0);
  EXPECT_THAT(ask("reference show --run 1").error, HasSubstr("run 1 has no reference"));
  EXPECT_THAT(ask("identify --run 1 --channels outside").error, HasSubstr("0 positions from outside"));
  EXPECT_EQ(ask("verify --audit").exit_code, 0);
}

TEST_F(ReferenceTools, WhatIsWrongIsOneLine) {
  EXPECT_THAT(ask("reference import --run 1 --csv @none.csv --sd-mm 1").error, HasSubstr("cannot be read"));
  EXPECT_THAT(ask("reference import --run 7 --csv @camera.csv --sd-mm 1").error, HasSubstr("there is no run 7"));
  EXPECT_THAT(ask("reference import --run 1 --csv @camera.csv").error, HasSubstr("--sd-mm"));
  EXPECT_THAT(ask("reference import --run 1 --csv @camera.csv --sd-mm 1 --marker flash --at-s 1").error,
              HasSubstr("run 1 has no marker 'flash'"));
  EXPECT_EQ(ask("reference import --run 1 --csv @camera.csv --marker flash").exit_code, 2);
  EXPECT_EQ(ask("reference import --run 1 --csv @camera.csv --offset-s 1 --utc-s 1").exit_code, 2);
}

}  // namespace
}  // namespace server
