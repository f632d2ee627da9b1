// A run made of what was recorded already is the run that would have been made then; and what is said of a run, or
// noted in a recording, is kept with who said it.
#include <random>

#include "server/storage/runs/run_spans.hpp"
#include "server/storage/runs/run_store.hpp"
#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

class RunAfterwardsTest : public RecordingTest {
 protected:
  static constexpr std::int64_t kOffset_us = 1'700'000'000'000'000;  // UTC of the robot's time 0

  void SetUp() override {
    start();
    clock_.run_for(100s);
  }
  std::int64_t utc_of(std::uint64_t seq) const { return kOffset_us + static_cast<std::int64_t>(robot_.time_of(seq)); }
  Result<Run> made(storage::RecordedRange range) {
    return wait(runs_->make_afterwards(robot_.id, named("afterwards"), range, {"token:local", "", 0}));
  }
  void reboot() {
    disconnect(robot_);
    robot_.boot_id += 1;
    robot_.next_seq = robot_.oldest_seq = 0;
    robot_.late_us += 60'000'000;  // so that its time goes on where UTC does
    connect(robot_);
  }
  storage::RunDigest digest_of(storage::RunId run) {
    const auto found = wait(recording_->digester.find(run));
    EXPECT_TRUE(found && found->is_final);
    return found ? found->digest : storage::RunDigest{};
  }
  std::vector<std::pair<station::BootId, std::uint64_t>> samples_of(storage::RunId run) {
    std::vector<std::pair<station::BootId, std::uint64_t>> samples;
    for (const storage::StoredSample& sample : wait(history_->samples(run, std::nullopt, 10'000))->samples) {
      samples.emplace_back(sample.boot_id, sample.seq);
    }
    return samples;
  }

  TestRobot robot_;
};

TEST_F(RunAfterwardsTest, IsTheRunThatWouldHaveBeenMadeLive) {
  connect(robot_);
  make(robot_, 50);
  const storage::RunId live = wait(runs_->create(robot_.id, named("live")))->id;
  make(robot_, 60);
  robot_.next_seq += 10;
  make(robot_, 80);
  const std::int64_t from_us = utc_of(50);
  reboot();
  make(robot_, 40);
  ASSERT_TRUE(wait(runs_->end(live, "")).has_value());
  make(robot_, 30);
  const Result<Run> run = made(storage::TimeSpan{from_us, utc_of(39)});
  ASSERT_TRUE(run.has_value()) << run.error().detail;
  EXPECT_EQ(run->state, storage::RunState::ended);
  EXPECT_TRUE(run->made_afterwards);
  EXPECT_EQ(run->made_by, "token:local");
  EXPECT_EQ(run->firmware_version, "1.2.3");
  EXPECT_EQ(run->started_at_us, from_us);
  EXPECT_EQ(run->ended_at_us, utc_of(39));
  EXPECT_EQ(samples_of(run->id), samples_of(live));
  EXPECT_EQ(samples_of(run->id).size(), 180u);
  EXPECT_TRUE(digest_of(run->id).agrees_with(digest_of(live)));
}

TEST_F(RunAfterwardsTest, TakesSamplesByTheirNumbers) {
  connect(robot_);
  make(robot_, 250);
  const Result<Run> run = made(storage::SeqSpan{robot_.boot_id, 120, 219});
  ASSERT_TRUE(run.has_value()) << run.error().detail;
  ASSERT_EQ(run->spans.size(), 1u);
  EXPECT_EQ(run->spans[0].first_seq, 120u);
  EXPECT_EQ(run->spans[0].last_seq, 219u);
  EXPECT_EQ(run->samples_stored, 100u);
  EXPECT_EQ(run->ended_at_us, utc_of(219));
}

TEST_F(RunAfterwardsTest, HoldsEverySampleOfItsTimeAndNoOther) {
  std::mt19937 random{7};
  connect(robot_);
  for (int i = 0; i < 40; ++i) {
    if (random() % 5 == 0) robot_.next_seq += random() % 30;  // lost or late
    if (random() % 8 == 0) robot_.late_us += 10'000 * (random() % 20);
    robot_.context.setpoint_m = static_cast<float>(random() % 3);
    make(robot_, 1 + random() % 40, 1 + random() % 20);
  }
  flush();
  const storage::RunId all = made(storage::SeqSpan{robot_.boot_id, 0, robot_.next_seq - 1})->id;
  const std::vector<storage::StoredSample> samples = wait(history_->samples(all, std::nullopt, 10'000))->samples;
  for (int i = 0; i < 30; ++i) {
    const std::int64_t from_us =
        samples[random() % samples.size()].utc_us - static_cast<std::int64_t>(random() % 10'000);
    const std::int64_t to_us = from_us + static_cast<std::int64_t>(random() % 3'000'000);
    const auto expected = std::ranges::count_if(samples, [&](const storage::StoredSample& sample) {
      return sample.utc_us >= from_us && sample.utc_us <= to_us;
    });
    const Result<Run> run = made(storage::TimeSpan{from_us, to_us});
    EXPECT_EQ(run ? static_cast<std::int64_t>(run->samples_stored) : 0, expected) << from_us << " to " << to_us;
  }
}

TEST_F(RunAfterwardsTest, MayBeginAndEndInAGap) {
  connect(robot_);
  make(robot_, 50);
  robot_.next_seq += 100;  // 50..149 never arrive
  robot_.oldest_seq = 150;
  make(robot_, 50);
  const Result<Run> run = made(storage::TimeSpan{utc_of(120), utc_of(169)});
  ASSERT_TRUE(run.has_value());
  EXPECT_EQ(run->spans.at(0).first_seq, 120u);
  EXPECT_EQ(run->samples_stored, 20u);
  EXPECT_EQ(run->samples_lost, 30u);
}

// A robot that reboots often: no question is longer for it, and the disk thread has nothing to look for.
TEST_F(RunAfterwardsTest, ManyBootsAreSearchedAFewAtATime) {
  connect(robot_);
  for (int boot = 0; boot < 40; ++boot) {
    make(robot_, 10);
    reboot();
  }
  flush();
  SQLite::Database database = storage::open_for_reading(path_);
  storage::RangeSearch search{robot_.id, storage::TimeSpan{0, clock_.utc_us()}};
  EXPECT_TRUE(search.advance(database));
  EXPECT_FALSE(search.advance(database));
  EXPECT_EQ(search.take()->boots.size(), 40u);
  const Result<Run> run = made(storage::TimeSpan{0, clock_.utc_us()});
  ASSERT_TRUE(run.has_value()) << run.error().detail;
  EXPECT_EQ(run->spans.size(), 40u);
  EXPECT_EQ(run->samples_stored, 400u);
}

TEST_F(RunAfterwardsTest, ABootThatIsPurgedBeforeTheRunHoldsItIsNotOfTheRun) {
  connect(robot_);
  make(robot_, 100);
  const std::int64_t from_us = utc_of(0);
  reboot();
  make(robot_, 50);
  flush();
  SQLite::Database database = storage::open_for_reading(path_);
  storage::RangeSearch search{robot_.id, storage::TimeSpan{from_us, clock_.utc_us()}};
  ASSERT_FALSE(search.advance(database));
  const storage::RecordedSamples found = search.take().value();
  ASSERT_EQ(found.boots.size(), 2u);
  Run run;
  run.robot_id = robot_.id;
  const auto store = [run, found](storage::Database& disk) {
    return storage::RunStore{disk}.add_afterwards(run, found, {});
  };
  const auto purge = [](storage::Database& disk) {
    return disk.handle().exec("DELETE FROM segment WHERE boot_key = 1");
  };
  wait(recorder_->on_disk(purge));
  EXPECT_EQ(wait(recorder_->on_disk(store)), std::nullopt);
  EXPECT_EQ(number("SELECT count(*) FROM run"), 0);
  EXPECT_EQ(made(storage::TimeSpan{from_us, clock_.utc_us()})->spans.size(), 1u);
}

TEST_F(RunAfterwardsTest, RefusesWhatWasNotRecorded) {
  connect(robot_);
  make(robot_, 50);
  const auto code = [this](storage::RecordedRange range) { return made(range).error().code; };
  EXPECT_EQ(code(storage::TimeSpan{utc_of(0) - 2'000'000, utc_of(0) - 1'000'000}), ErrorCode::invalid);
  EXPECT_EQ(code(storage::TimeSpan{utc_of(10), utc_of(9)}), ErrorCode::invalid);
  EXPECT_EQ(code(storage::TimeSpan{utc_of(10), clock_.utc_us() + 1}), ErrorCode::invalid);
  EXPECT_EQ(code(storage::SeqSpan{robot_.boot_id, 10, 50}), ErrorCode::invalid);
  EXPECT_EQ(code(storage::SeqSpan{robot_.boot_id, 10, 9}), ErrorCode::invalid);
  EXPECT_EQ(code(storage::SeqSpan{1, 0, 9}), ErrorCode::not_found);
  EXPECT_EQ(number("SELECT count(*) FROM run"), 0);
}

TEST_F(RunAfterwardsTest, EachAnnotationLeavesANote) {
  connect(robot_);
  make(robot_, 50);
  const storage::RunId id = made(storage::SeqSpan{robot_.boot_id, 0, 49})->id;
  const storage::RunDigest before = digest_of(id);
  storage::RunAnnotation annotation;
  annotation.texts = {{"fluid", "water"}, {"notes", "a second look"}, {"name", "afterwards"}};
  annotation.has_mean_flow = true;
  annotation.mean_flow_m_s = 0.5;
  const Result<Run> run = wait(runs_->annotate(id, annotation, {"token:ana", "", 0}));
  ASSERT_TRUE(run.has_value());
  EXPECT_EQ(run->conditions.fluid, "water");
  EXPECT_EQ(run->conditions.mean_flow_m_s, 0.5);
  annotation.mean_flow_m_s.reset();
  annotation.texts = {{"fluid", "non_newtonian"}};
  EXPECT_EQ(wait(runs_->annotate(id, annotation, {"token:bob", "", 0}))->conditions.mean_flow_m_s, std::nullopt);
  EXPECT_EQ(rows("SELECT actor, field, before, after FROM run_note ORDER BY note_id"),
            (std::vector<std::string>{"token:ana|fluid||water", "token:ana|notes||a second look",
                                      "token:ana|mean_flow_m_s||0.5", "token:bob|fluid|water|non_newtonian",
                                      "token:bob|mean_flow_m_s|0.5|"}));
  EXPECT_TRUE(digest_of(id).agrees_with(before));
  annotation.texts = {{"name", ""}};
  EXPECT_EQ(wait(runs_->annotate(id, annotation, {})).error().code, ErrorCode::invalid);
  EXPECT_EQ(wait(runs_->annotate(99, {}, {})).error().code, ErrorCode::not_found);
}

TEST_F(RunAfterwardsTest, ADiscardedRunIsListedOnlyWhenAskedFor) {
  connect(robot_);
  make(robot_, 50);
  const storage::RunId kept = made(storage::SeqSpan{robot_.boot_id, 0, 9})->id;
  const storage::RunId dropped = made(storage::SeqSpan{robot_.boot_id, 10, 19})->id;
  const storage::RunId open = wait(runs_->create(robot_.id, named("open")))->id;
  EXPECT_EQ(wait(runs_->discard(open, "no", {})).error().code, ErrorCode::conflict);
  const Result<Run> run = wait(runs_->discard(dropped, "the pump was off", {"token:ana", "", 0}));
  ASSERT_TRUE(run.has_value());
  EXPECT_EQ(run->state, storage::RunState::discarded);
  const auto ids = [this](std::optional<storage::RunState> state) {
    std::vector<storage::RunId> found;
    for (const Run& one : wait(runs_->list({std::nullopt, state, 0, 100}))) found.push_back(one.id);
    return found;
  };
  EXPECT_EQ(ids(std::nullopt), (std::vector<storage::RunId>{open, kept}));
  EXPECT_EQ(ids(storage::RunState::discarded), (std::vector<storage::RunId>{dropped}));
  EXPECT_EQ(ids(storage::RunState::ended), (std::vector<storage::RunId>{kept}));
  EXPECT_EQ(ids(storage::RunState::open), (std::vector<storage::RunId>{open}));
  EXPECT_EQ(
      rows("SELECT actor, field, before, after FROM run_note"),
      (std::vector<std::string>{"token:ana|state|ended|discarded", "token:ana|discard_reason||the pump was off"}));
  EXPECT_EQ(wait(runs_->discard(dropped, "again", {})).error().code, ErrorCode::conflict);
  EXPECT_EQ(wait(runs_->annotate(dropped, {}, {})).error().code, ErrorCode::conflict);
}

TEST_F(RunAfterwardsTest, MarkersStandAtTheSampleOfTheirTime) {
  connect(robot_);
  make(robot_, 100);
  storage::Markers& markers = recording_->markers;
  const auto mark = [&](std::optional<std::int64_t> at_us, station::BootId boot_id = 0) {
    return wait(markers.add({robot_.id, "glucose in", "token:ana", at_us, boot_id}));
  };
  const Result<storage::Marker> now = mark(std::nullopt, robot_.boot_id);
  ASSERT_TRUE(now.has_value()) << now.error().detail;
  EXPECT_EQ(now->seq, 99u);
  flush();
  const Result<storage::Marker> then = mark(utc_of(40) + 3'000);
  ASSERT_TRUE(then.has_value());
  EXPECT_EQ(then->seq, 40u);
  EXPECT_EQ(then->boot_id, robot_.boot_id);
  EXPECT_EQ(then->robot_time_us, robot_.time_of(40));
  EXPECT_EQ(then->utc_us, utc_of(40));
  const station::BootId first_boot = robot_.boot_id;
  reboot();
  make(robot_, 10);
  flush();
  EXPECT_EQ(mark(utc_of(0) - 1)->boot_id, first_boot);
  EXPECT_EQ(mark(utc_of(0))->boot_id, robot_.boot_id);
  EXPECT_EQ(mark(kOffset_us).error().code, ErrorCode::invalid);
  EXPECT_EQ(mark(clock_.utc_us() + 1).error().code, ErrorCode::invalid);
  EXPECT_EQ(mark(std::nullopt).error().code, ErrorCode::not_connected);

  const storage::RunId run = made(storage::SeqSpan{first_boot, 0, 50})->id;
  const auto of_run = wait(markers.of_run(run, {}, 100));
  ASSERT_TRUE(of_run.has_value());
  ASSERT_EQ(of_run->markers.size(), 1u);
  EXPECT_EQ(of_run->markers.at(0).id, then->id);
  EXPECT_EQ(of_run->markers.at(0).text, "glucose in");
  EXPECT_EQ(of_run->markers.at(0).utc_us, then->utc_us);
  EXPECT_EQ(wait(markers.of_robot(robot_.id, 0, 100)).size(), 4u);
  EXPECT_EQ(wait(markers.of_robot(robot_.id, then->id, 1)).size(), 1u);
  EXPECT_EQ(wait(markers.of_robot("dory", 0, 100)).size(), 0u);
  EXPECT_EQ(wait(markers.of_run(99, {}, 100)).error().code, ErrorCode::not_found);
}

TEST_F(RunAfterwardsTest, ARunKeepsTheConfigurationItWasMadeUnder) {
  runs_->set_station_document("{\"limits\":1}");
  connect(robot_);
  make(robot_, 20);
  const storage::RunId first = wait(runs_->create(robot_.id, named("first")))->id;
  make(robot_, 20);
  reboot();
  make(robot_, 20);
  ASSERT_TRUE(wait(runs_->end(first, "")).has_value());
  runs_->set_station_document("{\"limits\":2}");
  const storage::RunId second = wait(runs_->create(robot_.id, named("second")))->id;
  make(robot_, 20);
  const auto in_force = [this](storage::RunId run) {
    std::vector<std::string> found;
    for (const storage::InForce& one : wait(runs_->snapshot(run))->in_force) {
      found.push_back(fmt::format("{} {} {} {}", one.span, one.kind, one.first_seq, one.content));
    }
    return found;
  };
  EXPECT_EQ(in_force(first), (std::vector<std::string>{"0 station 20 {\"limits\":1}", "1 station 0 {\"limits\":1}"}));
  EXPECT_EQ(in_force(second), (std::vector<std::string>{"0 station 20 {\"limits\":2}"}));
  EXPECT_EQ(number("SELECT count(*) FROM document"), 2);
  EXPECT_EQ(wait(runs_->snapshot(second))->firmware_version, "1.2.3");
  EXPECT_EQ(wait(runs_->snapshot(99)).error().code, ErrorCode::not_found);
}

}  // namespace
}  // namespace server
