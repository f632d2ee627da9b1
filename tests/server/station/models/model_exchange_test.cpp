// The exchange with a robot, without a station: what is sent, what is read back, and what ends it early.
#include "server/station/models/model_exchange.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "server/runtime/tasks.hpp"
#include "tests/server/station/models/reported_parameters.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Takes each parameter at once and reports it, as far as its members let it.
class FakeModelRobot final : public station::ModelRobot {
 public:
  FakeModelRobot() {
    robot.id = "r1";
    robot.boot_id = 7;
    robot.link = station::LinkState::connected;
  }

  const station::RobotState& state() const override { return robot; }
  const station::ParameterTable& parameters() const override { return table; }
  std::optional<bool> confirmation() const override { return flag; }
  std::uint64_t latest_naming() const override { return naming; }
  boost::asio::awaitable<Result<station::CommandRecord>> submit(station::CommandRequest request) override {
    const auto& parameter = request.action.action.set_parameter;
    const std::string name = parameter.name;
    sent.push_back(name);
    if (name == names_another_at) ++naming;
    station::CommandRecord record;
    record.state = refusal.empty() ? station::CommandState::acknowledged : station::CommandState::rejected;
    record.reason = refusal;
    if (refusal.empty()) take(name, parameter.value);
    co_return record;
  }

  station::RobotState robot;
  station::ParameterTable table;
  std::optional<bool> flag = false;
  std::uint64_t naming = 1;
  std::string refusal;           // of each command; empty: it takes them
  std::string bends;             // of this parameter it holds another value than it was sent
  std::string names_another_at;  // somebody names another fluid when this is sent
  bool shows_flag = true;
  std::vector<std::string> sent;

 private:
  void take(const std::string& name, float value) {
    report(table, name, name == bends ? std::nextafter(value, 0.0F) : value);
    if (name == "model_confirmed" && shows_flag) flag = value == 1;
  }
};

class ModelExchangeTest : public ::testing::Test {
 protected:
  ~ModelExchangeTest() override {
    tasks.stop();
    clock.settle();
  }

  void start(std::optional<station::FluidModel> model) {
    tasks.spawn("exchange", exchange({1, {"token:local", "", 0}, 7, "water", std::move(model)}));
    clock.settle();
  }
  std::string error() const { return outcome->has_value() ? "" : outcome->error().detail; }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  FakeModelRobot robot;
  std::optional<Result<void>> outcome;  // none: it goes on

 private:
  boost::asio::awaitable<void> exchange(station::FluidNaming naming) {
    station::ModelExchange exchange{clock, robot, std::move(naming)};
    const Result<void> result = co_await exchange.run();
    outcome = result;
  }
};

TEST_F(ModelExchangeTest, SendsWhatTheRobotDoesNotHoldAndThenTheConfirmation) {
  auto values = values_of(some_model());
  values["model_gain_1_m_s"] = 0;
  values.erase("model_time_constant_4_s");
  robot.table = table_of(values);
  start(some_model());
  clock.run_for(1s);
  ASSERT_TRUE(outcome && outcome->has_value());
  EXPECT_THAT(robot.sent, ElementsAre("model_gain_1_m_s", "model_time_constant_4_s", "model_confirmed"));
}

TEST_F(ModelExchangeTest, TakesTheConfirmationBackWithoutAModel) {
  robot.flag = true;
  start(std::nullopt);
  clock.run_for(1s);
  ASSERT_TRUE(outcome && outcome->has_value());
  EXPECT_THAT(robot.sent, ElementsAre("model_confirmed"));
  EXPECT_EQ(robot.flag, false);
}

// SAFETY's test: what is read back counts.
TEST_F(ModelExchangeTest, AValueThatComesBackOtherwiseEndsItBeforeTheConfirmation) {
  robot.bends = "model_gain_1_m_s";
  start(some_model());
  clock.run_for(3s);
  ASSERT_TRUE(outcome.has_value());
  EXPECT_THAT(error(), HasSubstr("model_gain_1_m_s = 0.25 was sent, and the robot holds 0.2"));
  EXPECT_THAT(robot.sent, ElementsAre("model_gain_1_m_s"));
}

TEST_F(ModelExchangeTest, AConfirmationThatTelemetryDoesNotShowFails) {
  robot.table = table_of(values_of(some_model()));
  robot.shows_flag = false;
  start(some_model());
  clock.run_for(3s);
  ASSERT_TRUE(outcome.has_value());
  EXPECT_EQ(error(), "the robot's telemetry does not show it");
}

TEST_F(ModelExchangeTest, NothingIsSentToARobotThatMovesAndItIsWaitedForThirtySeconds) {
  robot.robot.context.mode = rheonaut_MODE_AUTO;
  start(some_model());
  clock.run_for(station::ModelExchange::kPatience - 1s);
  EXPECT_FALSE(outcome.has_value());
  clock.run_for(2s);
  ASSERT_TRUE(outcome.has_value());
  EXPECT_EQ(outcome->error().reason, "motor_on");
  EXPECT_THAT(robot.sent, IsEmpty());
}

TEST_F(ModelExchangeTest, ARobotThatCoastsOrIsBusyIsAskedAgain) {
  for (const char* refusal : {"motor_on", "busy", "queue_full"}) {
    robot.sent.clear();
    robot.flag = true;
    robot.refusal = refusal;
    outcome.reset();
    start(std::nullopt);
    clock.run_for(1500ms);
    EXPECT_FALSE(outcome.has_value()) << refusal;
    EXPECT_GE(robot.sent.size(), 2U) << refusal;
    robot.refusal.clear();
    clock.run_for(2s);
    ASSERT_TRUE(outcome.has_value()) << refusal;
    EXPECT_TRUE(outcome->has_value()) << refusal;
  }
}

TEST_F(ModelExchangeTest, AnyOtherRefusalEndsIt) {
  robot.refusal = "out_of_range";
  start(some_model());
  ASSERT_TRUE(outcome.has_value());
  EXPECT_EQ(outcome->error().code, ErrorCode::rejected);
  EXPECT_EQ(error(), "model_gain_1_m_s = 0.25: rejected, out_of_range");
}

TEST_F(ModelExchangeTest, EndsWhenAnotherFluidIsNamedTheRobotBootsOrTheLinkBreaks) {
  robot.names_another_at = "model_gain_1_m_s";
  start(some_model());
  ASSERT_TRUE(outcome.has_value());
  EXPECT_EQ(outcome->error().reason, "superseded");
  EXPECT_EQ(robot.sent.size(), 1U);

  robot.naming = 1;
  robot.robot.boot_id = 8;
  start(some_model());
  EXPECT_EQ(outcome->error().reason, "booted");
  robot.robot.boot_id = 7;
  robot.robot.link = station::LinkState::disconnected;
  start(some_model());
  EXPECT_EQ(outcome->error().reason, "not_connected");
  EXPECT_EQ(robot.sent.size(), 1U);
}

}  // namespace
}  // namespace server
