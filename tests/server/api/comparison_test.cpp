// Runs side by side without a station: alignment, the common grid, differences, impedance over position.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/analysis/comparison/aligned_runs.hpp"
#include "server/analysis/comparison/aligned_runs_json.hpp"
#include "server/analysis/comparison/impedance_map.hpp"

namespace server {
namespace {

using analysis::AlignAt;
using analysis::Alignment;
using analysis::TracePoint;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// A recording at 100 Hz of a robot whose position grows by 1 mm a sample.
class Trace {
 public:
  TracePoint& add() {
    TracePoint point;
    point.span = span;
    point.seq = next_seq;
    point.robot_time_us = 3'000'000 + next_seq * 10'000;
    point.utc_us = 1'750'000'000'000'000 + static_cast<std::int64_t>(next_seq) * 10'000;
    point.position_m = 0.001F * static_cast<float>(next_seq);
    point.setpoint_m = setpoint_m;
    point.disturbance_m = disturbance_m;
    point.duty = duty;
    point.is_manual = std::isnan(setpoint_m);
    ++next_seq;
    points.push_back(point);
    return points.back();
  }
  void add(int samples) {
    for (int i = 0; i < samples; ++i) add();
  }
  std::vector<double> times_s() const { return analysis::times_of(points); }

  std::vector<TracePoint> points;
  std::uint32_t span = 0;
  std::uint64_t next_seq = 0;
  float setpoint_m = kNaN, disturbance_m = 0, duty = 0;
};

Result<analysis::AlignedAt> aligned(const Trace& trace, const Alignment& alignment,
                                    const std::vector<storage::RunMoment>& moments = {}) {
  return find_alignment("run 7", trace.points, trace.times_s(), alignment, moments);
}

TEST(ComparedRuns, AreAlignedAtSetpointsDutiesAndDisturbances) {
  Trace trace;
  trace.add(20);
  trace.duty = 0.3F;
  trace.add(30);
  trace.duty = 0;
  trace.setpoint_m = 0.5F;
  trace.add(50);
  trace.disturbance_m = -0.05F;
  trace.add(10);
  EXPECT_EQ(aligned(trace, {})->at_s, 0);
  EXPECT_NEAR(aligned(trace, {AlignAt::step, 1, {}})->at_s, 0.2, 1e-9);
  EXPECT_EQ(aligned(trace, {AlignAt::step, 2, {}})->seq, 50U);
  EXPECT_NEAR(aligned(trace, {AlignAt::step, 2, {}})->uncertain_s, 0.01, 1e-9);
  EXPECT_NEAR(aligned(trace, {AlignAt::disturbance, 1, {}})->at_s, 1, 1e-9);
  const auto refused = aligned(trace, {AlignAt::step, 3, {}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().detail, "run 7 has no step 3, only 2");
  EXPECT_EQ(aligned(trace, {AlignAt::disturbance, 2, {}}).error().detail, "run 7 has no disturbance 2, only 1");
  EXPECT_EQ(aligned(Trace{}, {}).error().detail, "run 7 has no stored sample");
}

// As in the table of its steps: to hold is no step.
TEST(ComparedRuns, ARunThatBeginsWhileItHoldsIsAlignedAtItsFirstNewSetpoint) {
  Trace trace;
  trace.setpoint_m = 0.0001F;
  trace.add(20);
  trace.setpoint_m = 0.5F;
  trace.add(30);
  EXPECT_EQ(aligned(trace, {AlignAt::step, 1, {}})->seq, 20U);
}

TEST(ComparedRuns, AStepInAGapIsUncertainByIt) {
  Trace trace;
  trace.setpoint_m = 0.1F;
  trace.add(20);
  trace.next_seq += 30;
  trace.setpoint_m = 0.2F;
  trace.add(10);
  const auto second = aligned(trace, {AlignAt::step, 2, {}});
  EXPECT_NEAR(second->at_s, 0.5, 1e-9);
  EXPECT_NEAR(second->uncertain_s, 0.31, 1e-9);
}

TEST(ComparedRuns, AreAlignedAtEventsAndMarkersOnTheRobotsClock) {
  Trace trace;
  trace.add(10);
  trace.span = 1;  // a reboot, 2 s later by UTC
  for (int i = 0; i < 10; ++i) {
    trace.add();
    trace.points.back().robot_time_us -= 2'900'000;
    trace.points.back().utc_us += 2'000'000;
  }
  const std::vector<storage::RunMoment> moments{{0, 5, 3'050'000, "valve", kNaN, kNaN},
                                                {1, 13, 230'000, "pump", kNaN, kNaN},
                                                {1, 14, 240'000, "valve", kNaN, kNaN}};
  EXPECT_NEAR(aligned(trace, {AlignAt::marker, 1, {}}, moments)->at_s, 0.05, 1e-9);
  EXPECT_NEAR(aligned(trace, {AlignAt::marker, 2, {}}, moments)->at_s, 2.13, 1e-9);
  EXPECT_NEAR(aligned(trace, {AlignAt::marker, 2, "valve"}, moments)->at_s, 2.14, 1e-9);
  EXPECT_EQ(aligned(trace, {AlignAt::marker, 2, "pump"}, moments).error().detail,
            "run 7 has no marker 'pump' 2, only 1");
  EXPECT_THAT(analysis::check_alignment({AlignAt::event, 1, "birthday"}).error().detail, HasSubstr("no kind of event"));
  EXPECT_TRUE(analysis::check_alignment({AlignAt::event, 1, "detection"}));
  EXPECT_FALSE(analysis::check_alignment({AlignAt::start, 2, {}}));
}

analysis::GridTrace gridded(const Trace& trace, double aligned_at_s, const char* channels = "position_m,duty",
                            analysis::TraceGrid grid = {}, const storage::StoredReference* reference = nullptr) {
  const auto made = trace_on_grid("run 7", trace.points, trace.times_s(), aligned_at_s,
                                  analysis::parse_trace_channels(channels).value(), grid, reference);
  EXPECT_TRUE(made) << made.error().detail;
  return *made;
}

TEST(GridTraces, AreExactAtSamplesAndNullInGaps) {
  Trace trace;
  trace.add(5);
  trace.next_seq = 8;
  trace.add(3);
  const auto grid = gridded(trace, 0.02, "position_m");
  EXPECT_EQ(grid.first_row, -2);
  ASSERT_EQ(grid.rows(), 11U);
  for (const std::size_t row : {0U, 2U, 4U, 8U, 10U}) {
    EXPECT_FLOAT_EQ(grid.values[0][row], 0.001F * static_cast<float>(row)) << row;
  }
  for (const std::size_t row : {5U, 6U, 7U}) EXPECT_TRUE(std::isnan(grid.values[0][row])) << row;
}

TEST(GridTraces, ChangeInStraightLinesOrHold) {
  Trace trace;
  trace.add(2);
  trace.duty = 0.5F;
  trace.add(2);
  const auto grid = gridded(trace, 0.004);  // rows are 4 ms after samples
  ASSERT_EQ(grid.rows(), 3U);
  EXPECT_NEAR(grid.values[0][1], 0.0014, 1e-6);
  EXPECT_THAT(grid.values[1], ElementsAre(0, 0, 0.5F));
}

TEST(GridTraces, AreCutToTheirWindowAndBounded) {
  Trace trace;
  trace.add(100);
  const auto grid = gridded(trace, 0.5, "duty", {0.1, -0.2, 0.1});
  EXPECT_EQ(grid.first_row, -2);
  EXPECT_EQ(grid.rows(), 4U);
  trace.points.back().robot_time_us += 20'000'000'000;
  const auto refused = trace_on_grid("run 7", trace.points, trace.times_s(), 0,
                                     analysis::parse_trace_channels("duty").value(), {}, nullptr);
  EXPECT_THAT(refused.error().detail, HasSubstr("run 7 has 2000099 rows"));
}

storage::StoredReference reference_of(std::vector<std::uint64_t> times_us, std::vector<double> position_m) {
  storage::StoredReference reference;
  reference.positions.position_sd_m.assign(times_us.size(), 0.0003);
  reference.positions.robot_time_us = std::move(times_us);
  reference.positions.position_m = std::move(position_m);
  reference.reference.zero_sd_m = 0.0004;
  return reference;
}

TEST(GridTraces, APositionFromOutsideTakesThePlaceOfTheEstimate) {
  Trace trace;
  trace.disturbance_m = 0.05F;
  for (int i = 0; i < 40; ++i) trace.add().position_sd_m = 0.004F;
  const auto reference = reference_of({3'000'000, 3'100'000, 3'300'000}, {0.2, 0.3, 0.5});
  const auto grid = gridded(trace, 0, "position_m", {}, &reference);
  EXPECT_EQ(grid.position_source, analysis::PositionSource::outside);
  EXPECT_NEAR(grid.values[0][5], 0.25 + 0.05, 1e-6) << "between two of them, with the disturbance";
  EXPECT_NEAR(grid.position_sd_m[5], 0.0005, 1e-9) << "that of the zero counted";
  EXPECT_NEAR(grid.own_position_m[5], 0.005, 1e-9);
  EXPECT_TRUE(std::isnan(grid.values[0][20])) << "0.2 s without a position are a gap";
  EXPECT_NEAR(grid.values[0][30], 0.55, 1e-6);
  EXPECT_TRUE(std::isnan(grid.values[0][31]));
  EXPECT_EQ(gridded(trace, 0, "position_m").position_source, analysis::PositionSource::estimate);
}

TEST(GridTraces, APositionWhoseUncertaintyIsNotKnownIsAnEstimate) {
  Trace trace;
  for (int i = 0; i < 10; ++i) trace.add().position_sd_m = i == 5 ? std::nanf("") : 0;
  EXPECT_EQ(gridded(trace, 0, "position_m").position_source, analysis::PositionSource::estimate);
  for (TracePoint& point : trace.points) point.position_sd_m = 0;
  EXPECT_EQ(gridded(trace, 0, "position_m").position_source, analysis::PositionSource::known);
}

analysis::AlignedRun aligned_run(storage::RunId id, const Trace& trace, double at_s, const char* channels) {
  return {id, "a", {at_s, 0, 0, 0, 0}, gridded(trace, at_s, channels)};
}

TEST(AlignedRuns, HaveOneAxisAndDifferencesWithTheirSd) {
  Trace one, two;
  for (int i = 0; i < 10; ++i) one.add().position_sd_m = 0.003F;
  for (int i = 0; i < 6; ++i) two.add().position_sd_m = 0.004F;
  analysis::TracesRequest request;
  request.channels = analysis::parse_trace_channels("position_m").value();
  request.reference_run = 2;
  const auto made =
      put_together(request, {aligned_run(1, one, 0.02, "position_m"), aligned_run(2, two, 0, "position_m")});
  ASSERT_TRUE(made);
  ASSERT_THAT(made->time_s, SizeIs(10));
  EXPECT_NEAR(made->time_s[0], -0.02, 1e-12);
  const auto apart = difference(*made, 0, 0);
  EXPECT_TRUE(std::isnan(apart[1])) << "run 2 has nothing there";
  EXPECT_NEAR(apart[2], 0.002, 1e-8);
  EXPECT_TRUE(std::isnan(apart[8]));
  EXPECT_NEAR(difference_sd_m(*made, 0)[2], 0.005, 1e-8);
  const auto json = json_of(*made);
  EXPECT_EQ(json["reference_run_id"], 2);
  EXPECT_EQ(json["runs"][0]["traces"]["position_m"][0], 0);
  EXPECT_EQ(json["runs"][1]["traces"]["position_m"][0], nullptr) << "never a number in a gap";
  EXPECT_EQ(json["runs"][1]["differences"], nullptr);
  EXPECT_EQ(json["runs"][0]["position_source"], "estimate");
}

TEST(AlignedRuns, BecomeCoarserUntilTheyFitUnlessAGridWasAskedFor) {
  Trace trace;
  trace.add(1000);
  analysis::TracesRequest request;
  request.channels = analysis::parse_trace_channels("duty").value();
  request.most_values = 1000;  // of 1000 rows × 2 runs × 2
  const auto runs = [&] {
    return std::vector{aligned_run(1, trace, 0.02, "duty"), aligned_run(2, trace, 0.02, "duty")};
  };
  const auto made = put_together(request, runs());
  ASSERT_TRUE(made);
  EXPECT_NEAR(made->grid_s, 0.04, 1e-12);
  EXPECT_THAT(made->time_s, SizeIs(250));
  EXPECT_NEAR(made->time_s[0], 0, 1e-12) << "the moment of alignment stays";
  request.grid_us = 10'000;
  EXPECT_THAT(put_together(request, runs()).error().detail, HasSubstr("ask for a grid_us from 40000 on"));
}

// There and back over 100 mm, 1 mm a sample, with a patch of 120 mV from 40 to 60 mm.
Trace scan() {
  Trace trace;
  for (int i = 0; i <= 200; ++i) {
    TracePoint& point = trace.add();
    const int at_mm = i <= 100 ? i : 200 - i;
    point.position_m = 0.001F * static_cast<float>(at_mm) + 0.0002F;
    point.position_sd_m = 0.002F;
    point.impedance_mv = at_mm >= 40 && at_mm < 60 ? 120 : 175;
  }
  return trace;
}

TEST(ImpedanceMaps, APositionWhoseUncertaintyIsNotKnownIsAnEstimate) {
  Trace trace = scan();
  for (TracePoint& point : trace.points) point.position_sd_m = 0;
  trace.points[43].position_sd_m = std::nanf("");
  const auto map = impedance_map(3, trace.points, {}, 0.01, nullptr);
  ASSERT_TRUE(map);
  EXPECT_THAT(map->sources, ElementsAre(analysis::PositionSource::estimate));
  EXPECT_TRUE(std::isnan(map->bins.at({analysis::Direction::forward, 4}).position_sd_m));
  EXPECT_EQ(map->bins.at({analysis::Direction::forward, 5}).position_sd_m, 0);
  EXPECT_THAT(map->all_warnings(), ElementsAre(HasSubstr("the robot's own estimate"),
                                               HasSubstr("in 1 of 21 bins the sd of the position is not known")));
}

TEST(ImpedanceMaps, GoAndComeBackSeparately) {
  const Trace trace = scan();
  const std::vector<storage::RunMoment> events{{0, 44, 3'440'000, "detection", 0.044F, 120}};
  const auto map = impedance_map(3, trace.points, events, 0.01, nullptr);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->samples, 201U);
  const auto& forward = map->bins.at({analysis::Direction::forward, 4});
  EXPECT_EQ(forward.count, 10U);
  EXPECT_EQ(forward.mean_mv, 120);
  EXPECT_EQ(forward.sd_mv(), 0);
  const auto& back = map->bins.at({analysis::Direction::backward, 5});
  EXPECT_EQ(back.count, 10U);
  EXPECT_EQ(back.min_mv, 120);
  EXPECT_NEAR(back.position_sd_m, 0.002, 1e-8);
  EXPECT_EQ(map->bins.at({analysis::Direction::forward, 6}).mean_mv, 175);
  ASSERT_THAT(map->events, SizeIs(1));
  EXPECT_NEAR(map->events[0].at_s, 0.44, 1e-9);
  EXPECT_NEAR(map->events[0].position_m, 0.0442, 1e-6);
  EXPECT_TRUE(map->has_detections());
  EXPECT_THAT(map->all_warnings(), ElementsAre(HasSubstr("the robot's own estimate")));
}

TEST(ImpedanceMaps, SayWhereThePositionIsLessCertainThanTheBinIsWide) {
  const Trace trace = scan();
  const auto map = impedance_map(3, trace.points, {}, 0.001, nullptr);
  EXPECT_THAT(map->all_warnings(), ElementsAre(HasSubstr("estimate"), HasSubstr("larger than the bin is wide")));
  EXPECT_FALSE(map->has_detections());
}

TEST(ImpedanceMaps, UseThePositionFromOutsideAndLeaveOutWhatItMisses) {
  Trace trace = scan();
  trace.points[3].impedance_mv = kNaN;
  std::vector<std::uint64_t> times_us;
  std::vector<double> position_m;
  for (std::uint64_t i = 0; i <= 100; i += 5) {  // only on the way there, and 1 m further
    times_us.push_back(3'000'000 + i * 10'000);
    position_m.push_back(1 + 0.001 * static_cast<double>(i));
  }
  const auto reference = reference_of(times_us, position_m);
  const auto map = impedance_map(3, trace.points, {}, 0.01, &reference);
  EXPECT_EQ(map->samples_left_out, 101U);
  EXPECT_EQ(map->bins.begin()->first.second, 100);
  EXPECT_THAT(map->sources, ElementsAre(analysis::PositionSource::outside));
  EXPECT_TRUE(map->all_warnings().empty());
}

TEST(ImpedanceMaps, OfSeveralRunsAreOneOverAll) {
  Trace first = scan(), second = scan();
  for (TracePoint& point : second.points) point.impedance_mv += 10;
  const std::vector maps{*impedance_map(1, first.points, {}, 0.01, nullptr),
                         *impedance_map(2, second.points, {}, 0.01, nullptr)};
  const auto all = together(maps);
  const auto& bin = all.bins.at({analysis::Direction::forward, 4});
  EXPECT_EQ(bin.count, 20U);
  EXPECT_EQ(bin.runs, 2U);
  EXPECT_NEAR(bin.mean_mv, 125, 1e-9);
  EXPECT_NEAR(bin.sd_mv().value(), 5 * std::sqrt(20.0 / 19), 1e-9);
  EXPECT_EQ(bin.min_mv, 120);
  const auto json = json_of(all);
  EXPECT_THAT(json["run_ids"], ElementsAre(1, 2));
  EXPECT_EQ(json["forward"]["from_m"].size(), json["forward"]["sd_mv"].size());
}

TEST(ImpedanceMaps, HaveABoundedNumberOfBins) {
  Trace trace;
  for (int i = 0; i < 2100; ++i) trace.add().impedance_mv = 175;
  EXPECT_EQ(impedance_map(3, trace.points, {}, 0.001, nullptr).error().reason, "too_many_bins");
}

}  // namespace
}  // namespace server
