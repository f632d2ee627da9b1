// Overviews of a recording, compared with a walk over every sample.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <span>

#include "server/storage/query/overview.hpp"
#include "tests/server/recording/random_recording.hpp"

namespace server {

class OverviewFixture : public RandomRecordingTest {
 protected:
  storage::Overview overview(storage::Excerpt excerpt, std::size_t points,
                             storage::OverviewChannels channels = storage::OverviewChannels{}.set()) {
    return wait(history_->overview(std::move(excerpt), {.points = points, .channels = channels})).value();
  }

  // The points stand for the samples one after another.
  static void expect_same(const storage::OverviewColumns& columns, std::span<const storage::StoredSample> samples,
                          storage::OverviewChannels channels = storage::OverviewChannels{}.set()) {
    std::size_t begin = 0;
    for (std::size_t point = 0; point < columns.samples.size(); ++point) {
      ASSERT_GT(columns.samples[point], 0u);
      ASSERT_LE(begin + columns.samples[point], samples.size());
      const auto of_point = samples.subspan(begin, columns.samples[point]);
      EXPECT_EQ(columns.first_utc_us[point], of_point.front().utc_us);
      EXPECT_EQ(columns.last_utc_us[point], of_point.back().utc_us);
      for (std::size_t channel = 0; channel < storage::kOverviewChannels; ++channel) {
        if (channels[channel]) expect_extremes(columns, channel, point, of_point);
      }
      begin += columns.samples[point];
    }
    EXPECT_EQ(begin, samples.size());
  }

  static void expect_extremes(const storage::OverviewColumns& columns, std::size_t channel, std::size_t point,
                              std::span<const storage::StoredSample> samples) {
    SCOPED_TRACE(storage::overview_name(channel));
    float min = NAN;
    float max = NAN;
    for (const storage::StoredSample& stored : samples) {
      const float value = storage::overview_value(channel, stored.sample, stored);
      min = std::fmin(min, value);
      max = std::fmax(max, value);
    }
    const float found_min = columns.min[channel].at(point);
    const float found_max = columns.max[channel].at(point);
    EXPECT_TRUE(found_min == min || (std::isnan(found_min) && std::isnan(min))) << found_min << " " << min;
    EXPECT_TRUE(found_max == max || (std::isnan(found_max) && std::isnan(max))) << found_max << " " << max;
  }

  // A robot with samples without a hole, stored in segments of 100.
  storage::RunId record_plain(std::size_t samples) {
    start();
    connect(robot_);
    const storage::RunId run = wait(runs_->create(robot_.id, named("run")))->id;
    make(robot_, samples, 25);
    flush();
    return run;
  }
};

}  // namespace server
