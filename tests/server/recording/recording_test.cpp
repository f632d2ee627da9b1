// What stands for the station and its robots in the recording tests.
#include "tests/server/recording/recording_test.hpp"

#include <stdlib.h>

#include <algorithm>

namespace server {

station::SampleBatch TestRobot::batch(std::uint64_t first_seq, std::size_t count) const {
  station::SampleBatch batch;
  batch.robot_id = id;
  batch.boot_id = boot_id;
  batch.first_seq = first_seq;
  batch.first_robot_time_us = time_of(first_seq);
  batch.oldest_seq = oldest_seq;
  batch.context = context;
  batch.utc_offset_us = 1'700'000'000'000'000;
  batch.clock_uncertainty_us = 300;
  for (std::uint64_t seq = first_seq; seq < first_seq + count; ++seq) {
    batch.samples.push_back({.position_m = static_cast<float>(seq) / 1000, .impedance_mv = 175});
  }
  return batch;
}

RecordingTest::RecordingTest() {
  std::string folder = (std::filesystem::temp_directory_path() / "rheonaut-test-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + folder};
  folder_ = folder;
  path_ = folder_ / "station.sqlite";
  clock_.add_worker(disk_);
  clock_.add_worker(readers_);
  clock_.add_worker(checkpoints_);
  clock_.add_worker(exports_worker_);
}

RecordingTest::~RecordingTest() {
  kill();
  std::filesystem::remove_all(folder_);
}

void RecordingTest::start(storage::RecorderOptions options, const config::RecordingConfig& config) {
  options.path = path_;
  options.enrolment.most_robots = most_robots_;
  options.enrolment.most_a_minute = most_a_minute_;
  tasks_ = std::make_unique<runtime::TaskGroup>(loop_);
  recording_ = std::make_unique<storage::RecordingParts>(loop_, clock_, disk_, readers_, exports_worker_, checkpoints_,
                                                         options, config);
  clock_.add_worker(recording_->backups.checker());
  clock_.add_worker(recording_->jobs.worker());
  recorder_ = &recording_->recorder;
  runs_ = &recording_->runs;
  history_ = &recording_->history;
  recorder_->set_on_durable([this](const station::RobotId& robot_id, station::BootId boot_id, std::uint64_t next_seq,
                                   std::uint64_t next_event_seq) {
    durable_next_seqs_[boot_id] = next_seq;
    if (latest_boots_[robot_id] != boot_id) return;  // no longer connected
    durable_next_seq_ = next_seq;
    durable_next_event_seq_ = next_event_seq;
  });
  recorder_->set_on_missing([this](const station::RobotId&, station::BootId, std::uint64_t first_seq,
                                   std::uint64_t next_seq) { missing_.push_back({first_seq, next_seq}); });
  recorder_->set_on_missing_events([this](const station::RobotId&, station::BootId) { ++missing_events_; });
  restored_ = wait(recording_->open());
  recording_->spawn(*tasks_);
  clock_.settle();
}

void RecordingTest::stop() {
  tasks_->stop();
  clock_.settle();
  EXPECT_EQ(tasks_->exit_code(), 0);
  recording_->close();
  kill();
}

void RecordingTest::kill() {
  if (tasks_) tasks_->stop();
  clock_.settle();
  if (recording_) {
    clock_.remove_worker(recording_->backups.checker());
    clock_.remove_worker(recording_->jobs.worker());
  }
  recorder_ = nullptr;
  runs_ = nullptr;
  history_ = nullptr;
  recording_.reset();
  tasks_.reset();
}

station::AdmissionRequest RecordingTest::hello_of(const TestRobot& robot) {
  station::AdmissionRequest request;
  request.robot_id = robot.id;
  request.token = robot.token;
  request.from_loopback = robot.from_loopback;
  request.boot_id = robot.boot_id;
  request.firmware_version = "1.2.3";
  request.sample_period_us = robot.context.period_us;
  request.robot_time_us = robot.time_of(robot.next_seq);
  request.oldest_seq = robot.oldest_seq;
  request.next_seq = robot.next_seq;
  request.oldest_event_seq = robot.oldest_event_seq;
  request.next_event_seq = robot.next_event_seq;
  request.acknowledged_next_seq = robot.acknowledged_next_seq;
  request.acknowledged_next_event_seq = robot.acknowledged_next_event_seq;
  request.received_at_us = clock_.utc_us();
  return request;
}

station::Admission RecordingTest::admit(const TestRobot& robot) { return wait(recorder_->admit(hello_of(robot))); }

station::RobotState RecordingTest::state_of(const TestRobot& robot, station::LinkState link) const {
  station::RobotState state;
  state.id = robot.id;
  state.link = link;
  state.boot_id = robot.boot_id;
  state.firmware_version = "1.2.3";
  state.controller_checksum = robot.controller_checksum;
  state.context = robot.context;
  state.latest_robot_time_us = robot.time_of(robot.next_seq);
  return state;
}

void RecordingTest::connect(const TestRobot& robot) {
  const station::Admission admission = admit(robot);
  ASSERT_EQ(admission.refusal, rheonaut_REFUSAL_REASON_NONE) << admission.detail;
  latest_boots_[robot.id] = robot.boot_id;
  const station::RobotState state = state_of(robot, station::LinkState::connected);
  recorder_->on_robot(state);
  runs_->on_robot(state);
}

void RecordingTest::disconnect(const TestRobot& robot) {
  const station::RobotState state = state_of(robot, station::LinkState::disconnected);
  recorder_->on_robot(state);
  runs_->on_robot(state);
}

void RecordingTest::make(TestRobot& robot, std::size_t count, std::size_t per_frame) {
  while (count > 0) {
    const std::size_t size = std::min(count, per_frame);
    send(robot, robot.next_seq, size);
    robot.next_seq += size;
    count -= size;
  }
}

void RecordingTest::make_slowly(TestRobot& robot, std::size_t count) {
  for (std::size_t made = 0; made < count; made += 5) {
    clock_.run_for(50ms);
    make(robot, 5);
  }
}

void RecordingTest::send(const TestRobot& robot, std::uint64_t first_seq, std::size_t count) {
  send(robot, robot.batch(first_seq, count));
}

void RecordingTest::send(const TestRobot& robot, const station::SampleBatch& batch) {
  station::SampleBatch received = batch;
  received.received_at_us = clock_.utc_us();
  station::RobotState state = state_of(robot, station::LinkState::connected);
  state.latest_robot_time_us = std::max(state.latest_robot_time_us, robot.time_of(batch.next_seq()));
  recorder_->on_samples(state, received);
  runs_->on_samples(state, received);
}

std::int64_t RecordingTest::number(const std::string& sql) {
  return storage::open_for_reading(path_).execAndGet(sql).getInt64();
}

std::vector<std::string> RecordingTest::rows(const std::string& sql) {
  std::vector<std::string> found;
  SQLite::Database database = storage::open_for_reading(path_);
  SQLite::Statement query{database, sql};
  while (query.executeStep()) {
    std::string row;
    for (int column = 0; column < query.getColumnCount(); ++column) {
      row += (column == 0 ? "" : "|") + query.getColumn(column).getString();
    }
    found.push_back(row);
  }
  return found;
}

}  // namespace server
