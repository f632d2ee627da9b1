// All robots are stopped at once: every frame first, and nobody's trouble is another's.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>

#include "server/runtime/tasks.hpp"
#include "server/station/station.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Notes what is handed to it, and takes it as written at once.
class NotingLink final : public station::RobotLink {
 public:
  NotingLink(station::Station& station, station::RobotId id, std::vector<std::string>& notes)
      : station_{station}, id_{std::move(id)}, notes_{notes} {}

  const station::RobotId& robot_id() const override { return id_; }
  bool send(const protocol::Command&, std::int64_t) override { return true; }
  bool withdraw(station::CommandId) override { return false; }
  void send_emergency_stop(const protocol::Command& command) override {
    if (is_broken) throw std::runtime_error{"no memory"};
    notes_.push_back("frame " + id_);
    stop = command.command_id;
    station_.on_command_sent(*this, command.command_id);
    if (breaks_behind_it) throw std::runtime_error{"no memory"};
  }
  void acknowledge(std::uint64_t, std::uint64_t) override {}
  void request_resend(std::uint64_t, std::uint64_t) override {}
  void request_event_resend() override {}
  void close(const std::string&) override {}

  void obey() {
    protocol::CommandAck ack = rheonaut_CommandAck_init_zero;
    ack.command_id = stop;
    ack.result = rheonaut_COMMAND_RESULT_ACCEPTED;
    ack.emergency_id = 9;
    station_.on_command_ack(*this, ack);
  }

  bool is_broken = false;
  bool breaks_behind_it = false;  // the frame has left then
  station::CommandId stop = 0;

 private:
  station::Station& station_;
  station::RobotId id_;
  std::vector<std::string>& notes_;
};

class NotingSink final : public station::StationSink {
 public:
  explicit NotingSink(std::vector<std::string>& notes) : notes_{notes} {}
  void on_command(const station::CommandRecord& record) override {
    notes_.push_back("record " + record.robot_id);
    if (record.robot_id == broken) throw std::runtime_error{"no disk"};
  }
  station::RobotId broken;

 private:
  std::vector<std::string>& notes_;
};

class StopAllTest : public ::testing::Test {
 protected:
  StopAllTest() { station.add_sink(sink); }
  ~StopAllTest() override {
    tasks.stop();
    clock.settle();
  }

  NotingLink& connect(const station::RobotId& id) {
    links.push_back(std::make_unique<NotingLink>(station, id, notes));
    station::AdmissionRequest hello;
    hello.robot_id = id;
    hello.boot_id = 7;
    hello.received_at_us = clock.utc_us();
    station.on_connected(*links.back(), hello, protocol::Hello(rheonaut_Hello_init_zero), station::Admission{},
                         "memory");
    return *links.back();
  }

  void stop_all(microseconds patience = 1s) {
    auto task = [](StopAllTest& test, microseconds limit) -> boost::asio::awaitable<void> {
      station::StopRequest request;
      request.actor = "user:anna";
      test.outcome = co_await test.station.stop_all(std::move(request), limit);
    };
    tasks.spawn("stop all", task(*this, patience));
    clock.settle();
  }

  // Of "a"; what the sinks and the link throw is swallowed.
  void stop_one() {
    auto task = [](StopAllTest& test) -> boost::asio::awaitable<void> {
      station::StopRequest request;
      request.robot_id = "a";
      request.actor = "user:anna";
      try {
        co_await test.station.emergency_stop(std::move(request), 1s);
      } catch (const std::runtime_error&) {
        test.notes.push_back("exception");
      }
    };
    tasks.spawn("stop one", task(*this));
    clock.settle();
  }

  // To "a", whose link never says that it was sent.
  void submit_duty() {
    auto task = [](StopAllTest& test) -> boost::asio::awaitable<void> {
      station::CommandRequest request;
      request.robot_id = "a";
      request.actor = "user:anna";
      request.action.which_action = rheonaut_Command_set_duty_tag;
      request.action.action.set_duty.lease_ms = 500;
      co_await test.station.submit(std::move(request));
    };
    tasks.spawn("duty", task(*this));
    clock.settle();
  }

  boost::asio::io_context loop;
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  station::Station station{loop, clock, config::Envelope{}, config::LinkTimes{}};
  std::vector<std::string> notes;
  NotingSink sink{notes};
  std::vector<std::unique_ptr<NotingLink>> links;
  std::optional<station::StopsOfAll> outcome;
};

TEST_F(StopAllTest, EveryFrameIsHandedOverBeforeAnythingIsPublished) {
  for (const char* id : {"a", "b", "c"}) connect(id);
  stop_all();
  EXPECT_THAT(notes, ElementsAre("frame a", "frame b", "frame c", "record a", "record b", "record c"));
  EXPECT_FALSE(outcome.has_value()) << "it waits for their answers";
  for (const auto& link : links) link->obey();
  ASSERT_TRUE(clock.run_until([this] { return outcome.has_value(); }, 10ms));
  ASSERT_EQ(outcome->records.size(), 3u);
  for (const station::CommandRecord& record : outcome->records)
    EXPECT_EQ(record.state, station::CommandState::acknowledged);
  EXPECT_THAT(outcome->failed, IsEmpty());
}

TEST_F(StopAllTest, ItWaitsForAllTogetherNoLongerThanItsPatience) {
  for (const char* id : {"a", "b", "c"}) connect(id);
  stop_all(1s);
  links[1]->obey();
  EXPECT_FALSE(clock.run_until([this] { return outcome.has_value(); }, 990ms));
  ASSERT_TRUE(clock.run_until([this] { return outcome.has_value(); }, 20ms));
  EXPECT_EQ(outcome->records[0].state, station::CommandState::sent);
  EXPECT_EQ(outcome->records[1].state, station::CommandState::acknowledged);
}

TEST_F(StopAllTest, OneThatCannotBeStoppedKeepsNoOtherFromIt) {
  connect("a").is_broken = true;
  connect("b");
  sink.broken = "c";
  connect("c");
  stop_all();
  EXPECT_THAT(notes, ElementsAre("frame b", "frame c", "record b", "record c"));
  sink.broken.clear();
  for (std::size_t i : {1u, 2u}) links[i]->obey();
  ASSERT_TRUE(clock.run_until([this] { return outcome.has_value(); }, 10ms));
  EXPECT_THAT(outcome->failed, ElementsAre("a", "c"));
  ASSERT_EQ(outcome->records.size(), 1u);
  EXPECT_EQ(outcome->records[0].robot_id, "b");
}

// SAFETY: else a stop that the robot has not acknowledged would be unknown after a restart of the station.
TEST_F(StopAllTest, AStopIsRecordedThoughItsLinkFailsBehindIt) {
  connect("a").breaks_behind_it = true;
  stop_one();
  EXPECT_THAT(notes, ElementsAre("frame a", "record a", "exception"));
}

TEST_F(StopAllTest, ASinkThatFailsKeepsNoRecordFromBeingPublished) {
  connect("a");
  submit_duty();
  notes.clear();
  sink.broken = "a";
  stop_one();
  EXPECT_THAT(notes, ElementsAre("frame a", "record a", "record a", "exception")) << "of the stop and of the duty";
}

// A sink that fails at the events of one robot.
class FailsAtEvents final : public station::StationSink {
 public:
  void on_event(const station::RobotState& robot, const station::RobotEvent&) override {
    if (robot.id == "a") throw std::runtime_error{"no disk"};
  }
};

TEST_F(StopAllTest, ARightEndsAtEachRobotThoughOneFails) {
  for (const char* id : {"a", "b"}) {
    connect(id);
    ASSERT_TRUE(station.control({id, "user:anna", "", station::ControlAction::take, 20s, ""}));
  }
  static FailsAtEvents fails;  // it outlives the station
  station.add_sink(fails);
  station.end_right({[](const std::string& actor) { return actor == "user:anna"; }, "a test"});
  EXPECT_EQ(station.holder("a"), "");
  EXPECT_EQ(station.holder("b"), "");
}

TEST_F(StopAllTest, ARobotThatIsAwayIsNotWaitedFor) {
  connect("a");
  station.on_disconnected(*links[0], "gone");
  stop_all(1s);
  ASSERT_TRUE(outcome.has_value());
  EXPECT_EQ(outcome->records[0].state, station::CommandState::queued);
}

TEST_F(StopAllTest, OnlyARetiredRobotThatIsNotConnectedIsLeftOut) {
  for (const char* id : {"away", "retired", "there"}) connect(id);
  clock.run_for(1s);
  for (std::size_t i : {0u, 1u}) station.on_disconnected(*links[i], "gone");
  station.set_retired("retired", clock.utc_us(), "token:admin");
  station.set_retired("there", clock.utc_us(), "token:admin");
  clock.run_for(61s);
  stop_all();
  links[2]->obey();
  ASSERT_TRUE(clock.run_until([this] { return outcome.has_value(); }, 10ms));
  EXPECT_THAT(outcome->left_out, ElementsAre("retired"));
  ASSERT_EQ(outcome->records.size(), 2u);
  EXPECT_EQ(outcome->records[0].robot_id, "away");
  EXPECT_EQ(outcome->records[1].robot_id, "there") << "retired, and connected";
  EXPECT_FALSE(station.find("retired")->pending_stop);
}

TEST_F(StopAllTest, ARetiredRobotThatMayDriveSinceBeforeTheStationStartedIsStopped) {
  station.restore({{.id = "a", .retired_at_us = clock.utc_us()}}, {});
  clock.run_for(1s);
  stop_all();
  ASSERT_TRUE(outcome.has_value());
  EXPECT_THAT(outcome->left_out, IsEmpty());
  EXPECT_EQ(outcome->records.at(0).state, station::CommandState::queued) << "it is stopped when it comes back";
}

TEST_F(StopAllTest, ARetiredRobotThatConnectedAgainIsStoppedForAMinuteAfterItsLinkWasLost) {
  station.restore({{.id = "a", .retired_at_us = clock.utc_us()}}, {});
  clock.run_for(1s);
  connect("a");
  clock.run_for(1s);
  station.on_disconnected(*links[0], "gone");
  clock.run_for(59s);
  stop_all();
  ASSERT_TRUE(outcome.has_value());
  EXPECT_THAT(outcome->left_out, IsEmpty()) << "it may move on without its link";
  EXPECT_EQ(outcome->records.at(0).state, station::CommandState::queued);
  clock.run_for(2s);
  stop_all();
  EXPECT_THAT(outcome->left_out, ElementsAre("a"));
  station.set_retired("a", 0, "token:admin");
  stop_all();
  EXPECT_THAT(outcome->left_out, IsEmpty());
}

}  // namespace
}  // namespace server
