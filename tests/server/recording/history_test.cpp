// Pages of samples, gaps, events and commands give back what was recorded.
#include "server/storage/query/history.hpp"

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class HistoryTest : public RecordingTest {
 protected:
  TestRobot robot_;

  storage::RunId create() { return wait(runs_->create(robot_.id, named("run")))->id; }
  storage::SamplePage page(storage::RunId id, std::optional<storage::SampleCursor> after, std::size_t limit) {
    return wait(history_->samples(id, after, limit)).value();
  }
};

// From memory while the sample waits, and from the database afterwards.
TEST_F(HistoryTest, GivesBackEveryValueOfASample) {
  start();
  connect(robot_);
  robot_.context.setpoint_m = 0.1F;
  robot_.context.mode = rheonaut_MODE_AUTO;
  robot_.context.sub_state = rheonaut_SUB_STATE_NAVIGATING;
  robot_.context.disturbance_m = -0.05F;
  robot_.context.position_sd_m = 0.002F;
  robot_.context.controller_id = 0xfffffffe;
  robot_.context.emergency_id = 0xfedcba9876543211;
  robot_.context.emergency_cause = rheonaut_EMERGENCY_CAUSE_POSITION_LIMIT;
  robot_.context.flags = rheonaut_TELEMETRY_FLAG_BACKFILL;
  const storage::RunId id = create();
  station::SampleBatch batch = robot_.batch(0, 2);
  batch.samples[1] = {1, 2, 3, -0.5, 175, 0.1F};
  send(robot_, batch);
  const std::int64_t received_at_us = clock_.utc_us();
  for (const std::int64_t on_disk : {0, 2}) {
    SCOPED_TRACE(on_disk);
    if (on_disk > 0) flush();
    EXPECT_EQ(number("SELECT count(*) FROM sample"), on_disk);
    const storage::SamplePage all = page(id, std::nullopt, 10);
    ASSERT_EQ(all.samples.size(), 2u);
    EXPECT_FALSE(all.next.has_value());
    const storage::StoredSample& stored = all.samples[1];
    EXPECT_EQ(stored.span, 0u);
    EXPECT_EQ(stored.boot_id, robot_.boot_id);
    EXPECT_EQ(stored.seq, 1u);
    EXPECT_EQ(stored.robot_time_us, 510'000u);
    EXPECT_EQ(stored.utc_us, 1'700'000'000'510'000);
    EXPECT_EQ(stored.clock_uncertainty_us, 300);
    EXPECT_EQ(stored.first_received_at_us, received_at_us);
    EXPECT_EQ(stored.received_at_us, on_disk > 0 ? received_at_us : 0) << "others may follow in its segment";
    EXPECT_EQ(stored.sample, (station::Sample{1, 2, 3, -0.5, 175, 0.1F}));
    EXPECT_EQ(stored.mode, rheonaut_MODE_AUTO);
    EXPECT_EQ(stored.sub_state, rheonaut_SUB_STATE_NAVIGATING);
    EXPECT_EQ(stored.setpoint_m, 0.1F);
    EXPECT_EQ(stored.disturbance_m, -0.05F);
    EXPECT_EQ(stored.position_sd_m, 0.002F);
    EXPECT_EQ(stored.controller_id, 0xfffffffe);
    EXPECT_EQ(stored.emergency_id, 0xfedcba9876543211);
    EXPECT_EQ(stored.emergency_cause, rheonaut_EMERGENCY_CAUSE_POSITION_LIMIT);
    EXPECT_EQ(stored.flags, static_cast<std::uint32_t>(rheonaut_TELEMETRY_FLAG_BACKFILL));
  }
}

TEST_F(HistoryTest, PagesFollowOneAnotherOverSegmentsAndSpans) {
  start();
  connect(robot_);
  make(robot_, 37);
  const storage::RunId id = create();
  make(robot_, 230);
  robot_.boot_id += 1;
  robot_.next_seq = 0;
  connect(robot_);
  make(robot_, 120);
  for (const std::size_t limit : {1u, 7u, 100u, 230u, 349u, 350u, 10000u}) {
    SCOPED_TRACE(limit);
    std::vector<std::pair<std::uint32_t, std::uint64_t>> seen;
    std::optional<storage::SampleCursor> after;
    do {
      const storage::SamplePage next = page(id, after, limit);
      for (const storage::StoredSample& sample : next.samples) {
        seen.emplace_back(sample.span, sample.seq);
        EXPECT_FLOAT_EQ(sample.sample.position_m, static_cast<float>(sample.seq) / 1000);
      }
      after = next.next;
    } while (after);
    ASSERT_EQ(seen.size(), 350u);
    for (std::size_t i = 0; i < 350; ++i) {
      const std::pair<std::uint32_t, std::uint64_t> expected{i < 230 ? 0 : 1, i < 230 ? 37 + i : i - 230};
      ASSERT_EQ(seen[i], expected);
    }
  }
}

TEST_F(HistoryTest, AnswersHoldWhatWasReceivedBeforeTheQuestion) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  make(robot_, 3);
  EXPECT_EQ(page(id, std::nullopt, 10).samples.size(), 3u);
}

// A page in the browser asks each second, or more often.
TEST_F(HistoryTest, PollingARunWritesNothingAndCutsNoSegmentShort) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  for (std::size_t made = 5; made <= 400; made += 5) {
    make(robot_, 5);
    const auto commits = recorder_->counters().commits;
    EXPECT_EQ(page(id, std::nullopt, 1000).samples.size(), made);
    EXPECT_EQ(page(id, storage::SampleCursor{0, made - 2}, 1000).samples.size(), 1u);
    EXPECT_TRUE(wait(history_->gaps(storage::excerpt_of(id))).has_value());
    EXPECT_EQ(recorder_->counters().commits, commits);
    clock_.run_for(49ms);
  }
  clock_.run_for(2s);
  EXPECT_EQ(number("SELECT count(*) FROM sample"), 400);
  EXPECT_LE(number("SELECT count(*) FROM segment"), 6);
}

TEST_F(HistoryTest, SamplesThatArriveLateArePutInTheirPlaceWhileTheyWait) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  send(robot_, 0, 10);
  send(robot_, 30, 10);
  flush();
  send(robot_, 40, 5);
  send(robot_, 10, 15);
  for (const std::size_t limit : {1u, 3u, 12u, 40u, 100u}) {
    SCOPED_TRACE(limit);
    std::vector<std::uint64_t> seen;
    std::optional<storage::SampleCursor> after;
    do {
      const storage::SamplePage next = page(id, after, limit);
      for (const storage::StoredSample& sample : next.samples) seen.push_back(sample.seq);
      after = next.next;
    } while (after);
    ASSERT_EQ(seen.size(), 40u);
    for (std::uint64_t index = 0; index < 40; ++index) EXPECT_EQ(seen[index], index < 25 ? index : index + 5);
  }
}

TEST_F(HistoryTest, AnswersHoldWhatTheDiskDoesNotTake) {
  start();
  connect(robot_);
  const storage::RunId id = create();
  SQLite::Database foreign{path_.string(), SQLite::OPEN_READWRITE};
  foreign.exec("BEGIN IMMEDIATE");
  make(robot_, 100);
  robot_.oldest_seq = robot_.next_seq = 120;
  make(robot_, 5);
  ASSERT_TRUE(clock_.run_until([&] { return recorder_->failing(); }, 3s));
  const std::int64_t asked_us = clock_.steady_us();
  EXPECT_EQ(page(id, std::nullopt, 1000).samples.size(), 105u);
  const std::vector<storage::Gap> gaps = wait(history_->gaps(storage::excerpt_of(id))).value().gaps;
  ASSERT_EQ(gaps.size(), 1u);
  EXPECT_EQ(gaps[0].first_seq, 100u);
  EXPECT_EQ(gaps[0].last_seq, 119u);
  EXPECT_EQ(clock_.steady_us(), asked_us);
  foreign.exec("ROLLBACK");
  clock_.run_for(3s);
  EXPECT_EQ(wait(history_->gaps(storage::excerpt_of(id))).value().gaps.size(), 1u);
  EXPECT_EQ(page(id, std::nullopt, 1000).samples.size(), 105u);
}

TEST_F(HistoryTest, QueriesOfEventsAndCommandsCutNoSegmentShort) {
  start();
  connect(robot_);
  for (std::uint64_t n = 0; n < 20; ++n) {
    make(robot_, 5);
    station::RobotEvent event;
    event.robot_id = robot_.id;
    event.kind = "event " + std::to_string(n);
    recorder_->on_event(state_of(robot_, station::LinkState::connected), event);
    EXPECT_EQ(wait(history_->events(robot_.id, {.limit = 1})).records.at(0).kind, event.kind);
    EXPECT_EQ(wait(history_->commands(robot_.id, {.limit = 1})).records.size(), 0u);
    clock_.run_for(1ms);
  }
  clock_.run_for(2s);
  EXPECT_LE(number("SELECT count(*) FROM segment"), 6);  // 4 s, and no segment waits for more than 1 s
}

TEST_F(HistoryTest, RefusesUnknownRunsAndBadLimits) {
  start();
  EXPECT_EQ(wait(history_->samples(1, std::nullopt, 10)).error().code, ErrorCode::not_found);
  EXPECT_EQ(wait(history_->gaps(storage::excerpt_of(1))).error().code, ErrorCode::not_found);
  EXPECT_EQ(wait(history_->samples(1, std::nullopt, 0)).error().code, ErrorCode::invalid);
  EXPECT_EQ(wait(history_->samples(1, std::nullopt, 10001)).error().code, ErrorCode::invalid);
  EXPECT_EQ(wait(history_->command(1)).error().code, ErrorCode::not_found);
}

TEST_F(HistoryTest, ListsTheGapsOfARunCutToItsSpans) {
  start();
  connect(robot_);
  make(robot_, 10);
  robot_.next_seq = 20;
  const storage::RunId id = create();  // begins in sample 10, the newest is 9
  robot_.oldest_seq = 15;
  make(robot_, 10);
  const std::vector<storage::Gap> gaps = wait(history_->gaps(storage::excerpt_of(id))).value().gaps;
  ASSERT_EQ(gaps.size(), 1u);
  EXPECT_EQ(gaps[0].robot_id, robot_.id);
  EXPECT_EQ(gaps[0].boot_id, robot_.boot_id);
  EXPECT_EQ(gaps[0].first_seq, 10u);
  EXPECT_EQ(gaps[0].last_seq, 14u);
  EXPECT_EQ(gaps[0].cause, "ring_overrun");
}

TEST_F(HistoryTest, GivesBackEventsAndCommandsNewestFirst) {
  start();
  connect(robot_);
  for (std::uint64_t n = 0; n < 3; ++n) {
    station::RobotEvent event;
    event.robot_id = robot_.id;
    event.kind = "event " + std::to_string(n);
    if (n > 0) {
      event.boot_id = robot_.boot_id;
      event.event_seq = n - 1;
      event.mode = rheonaut_MODE_EMERGENCY;
      event.emergency_id = 0xf000000000000001;
    }
    recorder_->on_event(state_of(robot_, station::LinkState::connected), event);
    station::CommandRecord command;
    command.id = 0xf000000000000000 + n;
    command.robot_id = robot_.id;
    command.boot_id = robot_.boot_id;
    command.kind = "set_duty";
    command.state = station::CommandState::acknowledged;
    command.submitted_at_us = static_cast<std::int64_t>(n);
    recorder_->on_command(command);
  }
  const std::vector<station::RobotEvent> events = wait(history_->events(robot_.id, {.limit = 10})).records;
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0].kind, "event 2");
  EXPECT_EQ(events[0].boot_id, robot_.boot_id);
  EXPECT_EQ(events[0].event_seq, 1u);
  EXPECT_EQ(events[0].mode, rheonaut_MODE_EMERGENCY);
  EXPECT_EQ(events[0].emergency_id, 0xf000000000000001);
  EXPECT_EQ(events[2].boot_id, 0u);
  EXPECT_FALSE(events[2].event_seq.has_value());
  EXPECT_EQ(wait(history_->events(robot_.id, {.limit = 2})).records.size(), 2u);
  const std::vector<station::CommandRecord> commands = wait(history_->commands(robot_.id, {.limit = 2})).records;
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_EQ(commands[0].id, 0xf000000000000002);
  EXPECT_EQ(wait(history_->command(0xf000000000000001))->state, station::CommandState::acknowledged);
}

TEST_F(HistoryTest, EventsAndCommandsOfAWindowOfTimeAndCommandsWithoutRenewals) {
  start();
  connect(robot_);
  for (std::int64_t second = 1; second <= 4; ++second) {
    station::RobotEvent event;
    event.robot_id = robot_.id;
    event.kind = fmt::format("event {}", second);
    event.received_at_us = second * 1'000'000;
    recorder_->on_event(state_of(robot_, station::LinkState::connected), event);
    station::CommandRecord command;
    command.id = static_cast<station::CommandId>(second);
    command.robot_id = robot_.id;
    command.kind = second == 2 ? "set_duty" : "renew_lease";
    command.submitted_at_us = event.received_at_us;
    recorder_->on_command(command);
  }
  const storage::TimeWindow window{2'000'000, 4'000'000};  // without its end
  const std::vector<station::RobotEvent> events = wait(history_->events(robot_.id, {.window = window})).records;
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].kind, "event 3");
  EXPECT_EQ(events[1].kind, "event 2");
  EXPECT_EQ(wait(history_->commands(robot_.id, {.window = window})).records.size(), 2u);
  const auto without =
      wait(history_->commands(robot_.id, {.limit = 1, .renewals = storage::RenewalRows::none})).records;
  ASSERT_EQ(without.size(), 1u) << "renewals do not count";
  EXPECT_EQ(without[0].id, 2u);
}

}  // namespace
}  // namespace server
