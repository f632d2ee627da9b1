// What the commissioning of a robot finds while it lies still, from facts that are good and facts that are not; its
// plan, its record, and the person.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <random>

#include "server/cli/commission/person.hpp"
#include "server/cli/commission/plan.hpp"
#include "server/cli/commission/record.hpp"
#include "server/cli/commission/standstill.hpp"
#include "server/runtime/sha256.hpp"
#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

std::vector<double> noise_of(double mean, double sd, std::size_t count = 500) {
  std::mt19937 random{7};
  std::normal_distribution<double> normal{mean, sd > 0 ? sd : 1};
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(sd > 0 ? normal(random) : mean);
  return values;
}

RestFacts at_rest() {
  RestFacts facts;
  facts.acceleration_m_s2 = noise_of(0, 0.012);
  facts.impedance_mv = noise_of(176, 1);
  return facts;
}

Verdict imu_with(double mean, double sd) {
  RestFacts facts = at_rest();
  facts.acceleration_m_s2 = noise_of(mean, sd);
  return judge_imu_noise(facts).verdict;
}

StepFinding electrode_with(double mean, double sd) {
  RestFacts facts = at_rest();
  facts.impedance_mv = noise_of(mean, sd);
  return judge_electrode(facts);
}

TEST(CommissionStops, PassOnlyWhenEachIsConfirmed) {
  StopFacts facts{3, {4.0, 2.0, 9.0}, "", 1.5};
  const StepFinding good = judge_stops(facts);
  EXPECT_EQ(good.verdict, Verdict::pass);
  EXPECT_EQ(good.figures.at("median_ms"), 4.0);
  EXPECT_EQ(good.figures.at("worst_ms"), 9.0);
  facts.confirmed_ms[1] = 251;
  EXPECT_EQ(judge_stops(facts).verdict, Verdict::attention);
  facts.asked = 4;
  facts.not_confirmed = "stop 4 is not: the robot has not answered";
  const StepFinding bad = judge_stops(facts);
  EXPECT_EQ(bad.verdict, Verdict::fail);
  EXPECT_THAT(bad.found, HasSubstr("3 of 4 stops confirmed; stop 4 is not"));
  EXPECT_EQ(judge_stops({}).verdict, Verdict::fail);
  EXPECT_EQ(judge_stops({2, {1.0, 1.0}, "the emergency was not reset", {}}).verdict, Verdict::fail);
}

TEST(CommissionVersions, WantOneVersionAndACalibratedSensor) {
  VersionFacts facts{"sim-0.9.0", "0.9.0", "0.9.0", "power_on", 3, true};
  EXPECT_EQ(judge_versions(facts).verdict, Verdict::pass);
  facts.imu_calibration = 1;
  EXPECT_EQ(judge_versions(facts).verdict, Verdict::attention);
  facts = {"0.8.0", "0.9.0", "0.9.0", "power_on", 3, true};
  EXPECT_THAT(judge_versions(facts).action, HasSubstr("flash"));
  facts = {"0.9.0", "0.9.0", "0.9.0", "watchdog", 3, true};
  EXPECT_EQ(judge_versions(facts).verdict, Verdict::attention);
  facts = {"esp8266-10.9.0", "0.9.0", "0.9.0", "power_on", 3, true};
  EXPECT_EQ(judge_versions(facts).verdict, Verdict::attention) << "10.9.0 is not 0.9.0";
  facts = {"esp8266-0.9.0", "0.9.0", "0.9.0", "power_on", 3, false};
  EXPECT_THAT(judge_versions(facts).found, HasSubstr("calibration is not known"));
  EXPECT_EQ(judge_versions(facts).verdict, Verdict::attention);
}

TEST(CommissionAtRest, JudgesTheNoiseByWhatTheEstimatorAssumes) {
  EXPECT_EQ(imu_with(0, 0.012), Verdict::pass);
  EXPECT_EQ(imu_with(0, 0.025), Verdict::attention);
  EXPECT_EQ(imu_with(0, 0.06), Verdict::fail);
  EXPECT_EQ(imu_with(0, 0), Verdict::fail) << "a sensor that is stuck";
  EXPECT_EQ(imu_with(0.02, 0.012), Verdict::attention) << "a bias that the robot has not found";
  RestFacts facts = at_rest();
  facts.has_sensor_fault = true;
  EXPECT_EQ(judge_imu_noise(facts).verdict, Verdict::fail);
  facts = at_rest();
  facts.acceleration_m_s2.resize(100);
  EXPECT_EQ(judge_imu_noise(facts).verdict, Verdict::fail);
}

TEST(CommissionAtRest, JudgesTheElectrodeByTheBandOfTheMonitor) {
  EXPECT_EQ(electrode_with(176, 1).verdict, Verdict::pass);
  EXPECT_THAT(electrode_with(176, 15).found, HasSubstr("noisy"));
  EXPECT_EQ(electrode_with(176, 15).verdict, Verdict::fail);
  EXPECT_EQ(electrode_with(176, 6).verdict, Verdict::attention);
  EXPECT_THAT(electrode_with(3, 1).found, HasSubstr("open"));
  EXPECT_THAT(electrode_with(1023, 1).found, HasSubstr("saturated"));
  EXPECT_THAT(electrode_with(220, 1).action, HasSubstr("impedance_nominal_mv to 220"));
  EXPECT_EQ(electrode_with(175, 0).verdict, Verdict::attention) << "a reading that never changes";
}

TEST(CommissionPlan, BeginsSmallAndStaysWithinItsDuty) {
  for (const bool is_one_way : {false, true}) {
    const CommissionPlan plan{0.3, is_one_way};
    double largest_before = 0;
    for (const json& step : pushes_profile(plan).at("step")) {
      const double duty = step.value("duty", 0.0);
      EXPECT_LE(std::abs(duty), 0.3);
      if (is_one_way) EXPECT_GE(duty, 0);
      if (duty == 0) continue;
      EXPECT_GE(std::abs(duty), largest_before) << "the smallest first";
      largest_before = std::abs(duty);
    }
    for (const json& profile : {pushes_profile(plan), direction_profile(plan), steps_profile(plan)}) {
      EXPECT_LE(profile.at("limits").at("duty_max").get<double>(), 0.3);
      EXPECT_EQ(profile.at("step").back().at("kind"), "rest");
      EXPECT_LE(duration_of(profile), 20);
    }
  }
  EXPECT_NEAR(needed_m({0.3, false}), 0.4 * (4 * 0.3 * (0.03 + 0.06 + 0.1 + 0.2 + 0.3) + 0.2 + 0.3), 1e-9)
      << "the pushes count one way: a reverse that was never seen may drive forwards";
  EXPECT_NEAR(needed_m({0.3, true}), 0.4 * (2 * 0.3 * (0.03 + 0.06 + 0.1 + 0.2 + 0.3) + 0.2 + 4 * 0.3), 1e-9);
}

class CommissionRecordTest : public ToolTest {
 protected:
  CommissionRecordTest() {
    record_.robot_id = "rheo-1";
    record_.begun_at_us = 1'795'713'821'000'000;
    record_.ended_at_us = 1'795'713'881'000'000;
    record_.findings.push_back({.step = "stop_latency", .verdict = Verdict::pass, .found = "10 of 10 | confirmed"});
    record_.signed_by = "Ann";
  }
  std::string text_of(const std::filesystem::path& file) {
    std::ifstream in{file, std::ios::binary};
    return {std::istreambuf_iterator<char>{in}, {}};
  }
  CommissionRecord record_;
};

TEST_F(CommissionRecordTest, IsWrittenWithItsSumsAndNeverOverAnother) {
  const WrittenRecord written = write(record_, folder_);
  EXPECT_EQ(written.folder.filename(), "commission-rheo-1-20261126T172341Z");
  const std::string content = text_of(written.folder / "record.json");
  EXPECT_EQ(runtime::sha256_of(content), written.sha256);
  EXPECT_EQ(
      text_of(written.folder / "SHA256SUMS"),
      written.sha256 + "  record.json\n" + runtime::sha256_of(text_of(written.folder / "record.md")) + "  record.md\n");
  EXPECT_EQ(json::parse(content).at("signed_by"), "Ann");
  record_.signed_by = "Ben";
  EXPECT_THROW(write(record_, folder_), std::runtime_error);
  EXPECT_EQ(text_of(written.folder / "record.json"), content);
}

TEST_F(CommissionRecordTest, SaysWhyItIsNotSigned) {
  EXPECT_EQ(unsigned_reason(record_), "");
  EXPECT_STREQ(outcome_of(record_), "passed");
  record_.findings.push_back({.step = "electrode", .verdict = Verdict::attention});
  EXPECT_STREQ(outcome_of(record_), "passed_with_attention");
  record_.findings.push_back({.step = "imu_axis", .verdict = Verdict::fail});
  record_.findings.push_back(not_done("motor_constant", "not reached"));
  EXPECT_EQ(unsigned_reason(record_), "failed: imu_axis; not done: motor_constant");
  record_.ended_by = "interrupted";
  EXPECT_EQ(unsigned_reason(record_),
            "it ended before its end: interrupted; failed: imu_axis; not done: motor_constant");
  record_.unsigned_because = unsigned_reason(record_);
  record_.signed_by.clear();
  EXPECT_EQ(document_of(record_).at("outcome"), "not_passed");
  EXPECT_THAT(page_of(record_), HasSubstr("**Not signed**: it ended before its end"));
  EXPECT_THAT(page_of(record_), HasSubstr("10 of 10 \\| confirmed"));
}

TEST_F(CommissionRecordTest, OfARealRobotThatNobodyWatchedIsNotSigned) {
  record_.subject["firmware_version"] = "sim-0.9.0";
  record_.is_confirmed_beforehand = true;
  record_.prepared = {"direction", "free_ahead_m"};
  EXPECT_EQ(unsigned_reason(record_), "");
  EXPECT_EQ(document_of(record_).at("confirmed_by"), "nobody: --yes was given beforehand");
  EXPECT_EQ(document_of(record_).at("answers_given_beforehand"), (json{"direction", "free_ahead_m"}));
  EXPECT_THAT(page_of(record_), HasSubstr("confirmed by nobody: --yes was given beforehand. Answers given beforehand: "
                                          "direction, free_ahead_m."));
  record_.subject["firmware_version"] = "esp8266-0.9.0";
  EXPECT_THAT(unsigned_reason(record_), HasSubstr("nobody watched it"));
  record_.is_confirmed_beforehand = false;
  EXPECT_THAT(unsigned_reason(record_), HasSubstr("nobody watched it")) << "a direction that was known before";
  record_.prepared = {"free_ahead_m"};
  EXPECT_EQ(unsigned_reason(record_), "");
}

TEST_F(CommissionRecordTest, WithARunWithoutADigestIsNotSigned) {
  record_.runs.push_back({{"run_id", 7}, {"sha256", "ab"}});
  EXPECT_EQ(unsigned_reason(record_), "");
  record_.runs.push_back({{"run_id", 8}, {"sha256", nullptr}});
  EXPECT_EQ(unsigned_reason(record_), "run 8 has no digest");
}

TEST_F(CommissionRecordTest, SaysAsJsonThatTheStationHasNotNotedIt) {
  EXPECT_EQ(printed_of(record_, {"f", "ab"}, "refused").at("not_marked"), "refused");
  EXPECT_TRUE(printed_of(record_, {"f", "ab"}, "").at("not_marked").is_null());
}

TEST(CommissionPerson, NoticesSignalsInEveryLookAndWait) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    Interruption interruption;
    EXPECT_NO_THROW(interruption.throw_if_come());
    std::raise(signal);
    EXPECT_THROW(interruption.throw_if_come(), Interrupted);
    EXPECT_THROW(interruption.throw_if_come(), Interrupted) << "and again";
  }
  Interruption interruption;
  Person person{json::object(), true, interruption};
  EXPECT_NO_THROW(person.confirm("Is the way free?"));
  std::raise(SIGINT);
  EXPECT_THROW(interruption.wait(std::chrono::milliseconds{1}), Interrupted);
  EXPECT_THROW(person.confirm("Is the way free?"), Interrupted);
  EXPECT_THROW(person.word("direction", "Which way?", kDirections), Interrupted);
}

TEST(CommissionPerson, IsToldThingsAlsoWhenTheTerminalIsGone) {
  Interruption interruption;
  Person person{json::object(), true, interruption};
  const int kept = ::dup(STDERR_FILENO);
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  ::close(ends[0]);
  ::dup2(ends[1], STDERR_FILENO);
  EXPECT_NO_THROW(person.tell("the robot is stopped"));
  ::dup2(kept, STDERR_FILENO);
  ::close(kept);
  ::close(ends[1]);
}

TEST_F(CommissionRecordTest, RefusesAnswersThatAreNoneBeforeItBegins) {
  save("a.json", R"({"free_ahead_m": 1, "free_behind_m": -1, "direction": "forwards"})");
  EXPECT_THAT(ask("robot commission r --yes --answers @a.json").error, HasSubstr("free_behind_m must be a number"));
  save("a.json", R"({"direction": "sideways"})");
  EXPECT_THAT(ask("robot commission r --yes --answers @a.json").error,
              HasSubstr("one of forwards, backwards, nothing"));
  save("a.json", R"({"colour": "red"})");
  EXPECT_THAT(ask("robot commission r --yes --answers @a.json").error, HasSubstr("'colour' is no question"));
}

}  // namespace
}  // namespace server::cli
