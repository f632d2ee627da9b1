// A recording with everything in it that a recording can hold: losses, holes that are filled late or never, a reboot,
// clocks that are set, values that are no numbers; and a run over the most of it.
#pragma once

#include <random>

#include "tests/server/recording/recording_test.hpp"

namespace server {

class RandomRecordingTest : public RecordingTest {
 protected:
  // Begins a station and records with these random numbers; the last samples are not stored yet. Returns the run.
  storage::RunId record(unsigned seed, int rounds = 120);

  // Every sample of the run, page by page.
  std::vector<storage::StoredSample> samples_of(storage::RunId run);

  float any_value();
  station::SampleContext any_context();
  void make_some();

  TestRobot robot_;
  std::mt19937 random_;
  std::int64_t utc_step_us_ = 0;
  std::vector<station::SampleBatch> withheld_;  // made, and not sent yet
};

}  // namespace server
