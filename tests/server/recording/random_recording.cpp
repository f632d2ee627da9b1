// Everything follows from the seed.
#include "tests/server/recording/random_recording.hpp"

#include <limits>

namespace server {

float RandomRecordingTest::any_value() {
  switch (random_() % 12) {
    case 0: return std::numeric_limits<float>::quiet_NaN();
    case 1: return -0.0F;
    case 2: return std::numeric_limits<float>::infinity();
    case 3: return -std::numeric_limits<float>::denorm_min();
    case 4: return std::numeric_limits<float>::max();
    default: return static_cast<float>(random_() % 2000) / 7 - 100;
  }
}

station::SampleContext RandomRecordingTest::any_context() {
  station::SampleContext context = manual_at_100_hz();
  context.mode = random_() % 2 == 0 ? rheonaut_MODE_AUTO : rheonaut_MODE_EMERGENCY;
  context.sub_state = random_() % 2 == 0 ? rheonaut_SUB_STATE_NAVIGATING : rheonaut_SUB_STATE_NONE;
  if (random_() % 2 == 0) context.setpoint_m = static_cast<float>(random_() % 10) / 10;
  context.disturbance_m = static_cast<float>(random_() % 3) / 100;
  context.position_sd_m = static_cast<float>(random_() % 3) / 1000;
  context.controller_id = random_() % 2 == 0 ? 0xffffffffU : 3;
  context.emergency_id = random_() % 2 == 0 ? 0xfedcba9876543210 : 0;
  context.emergency_cause = random_() % 2 == 0 ? rheonaut_EMERGENCY_CAUSE_OPERATOR : rheonaut_EMERGENCY_CAUSE_NONE;
  context.flags = random_() % 64;
  if (context.flags % 5 == 0) context.disturbance_m.reset();  // no finite number
  if (context.flags % 7 == 0) context.position_sd_m.reset();
  if (context.flags % 3 == 0) context.mode = static_cast<protocol::Mode>(4 + 7 * context.flags);  // a newer firmware's
  if (context.flags % 4 == 0) context.sub_state = static_cast<protocol::SubState>(0x7fffffff);
  if (context.flags % 6 == 0) context.emergency_cause = static_cast<protocol::EmergencyCause>(200);
  return context;
}

void RandomRecordingTest::make_some() {
  if (random_() % 8 == 0) robot_.context = any_context();
  if (random_() % 20 == 0) robot_.oldest_seq = robot_.next_seq += random_() % 50;  // the ring ran over
  if (random_() % 20 == 0) robot_.late_us += random_() % 300'000;                  // periods were skipped
  if (random_() % 40 == 0) utc_step_us_ -= 3'600'000'000;                          // the station's clock was set back
  station::SampleBatch batch = robot_.batch(robot_.next_seq, 1 + random_() % 25);
  for (station::Sample& sample : batch.samples) {
    sample = {any_value(), any_value(), any_value(), any_value(), any_value(), std::numeric_limits<float>::quiet_NaN()};
  }
  batch.utc_offset_us += utc_step_us_;
  if (random_() % 10 == 0) batch.clock_uncertainty_us = -1;
  robot_.next_seq = batch.next_seq();
  if (random_() % 6 == 0) {
    withheld_.push_back(batch);
    return;
  }
  send(robot_, batch);
}

storage::RunId RandomRecordingTest::record(unsigned seed, int rounds) {
  random_.seed(seed);
  withheld_.clear();
  utc_step_us_ = 0;
  start();
  connect(robot_);
  make_some();
  const storage::RunId run = wait(runs_->create(robot_.id, named("everything")))->id;
  for (int round = 0; round < rounds; ++round) {
    if (round == rounds / 2) {
      withheld_.clear();
      robot_.boot_id += 1;
      robot_.next_seq = robot_.oldest_seq = 0;
      connect(robot_);
    }
    make_some();
    if (random_() % 4 == 0 && !withheld_.empty()) {  // backfill; the last withheld are never sent
      station::SampleBatch late = withheld_.front();
      late.context.flags |= rheonaut_TELEMETRY_FLAG_BACKFILL;
      withheld_.erase(withheld_.begin());
      send(robot_, late);
    }
    if (random_() % 3 == 0) clock_.run_for(microseconds{random_() % 300'000});
  }
  make(robot_, 3);  // tells how far it has come
  return run;
}

std::vector<storage::StoredSample> RandomRecordingTest::samples_of(storage::RunId run) {
  std::vector<storage::StoredSample> samples;
  std::optional<storage::SampleCursor> after;
  do {
    const storage::SamplePage page = wait(history_->samples(run, after, 777)).value();
    samples.insert(samples.end(), page.samples.begin(), page.samples.end());
    after = page.next;
  } while (after);
  return samples;
}

}  // namespace server
