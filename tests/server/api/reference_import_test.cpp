// Positions from outside, put onto the clock and the zero of a run.
#include "server/analysis/reference_import.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace server {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

// Two humps of different height and length: a motion that does not repeat.
double truth_m(double at_s) {
  const auto hump = [at_s](double centre_s, double width_s) {
    return std::exp(-std::pow((at_s - centre_s) / width_s, 2));
  };
  return 0.2 * hump(8, 1.5) - 0.1 * hump(14, 0.8) + 0.15 * hump(22, 2);
}

class ReferenceImportTest : public ::testing::Test {
 protected:
  ReferenceImportTest() {
    for (int k = 0; k <= 3000; ++k) {
      analysis::OwnPosition sample;
      sample.robot_time_us = 5'000'000 + static_cast<std::uint64_t>(k) * 10'000;
      sample.utc_us = 1'767'225'600'000'000 + k * 10'000;
      sample.clock_uncertainty_us = 600;
      sample.position_m = static_cast<float>(truth_m(0.01 * k));
      sample.position_sd_m = 0.002F;
      own.push_back(sample);
    }
    request.source = "camera.csv";
    request.sd_m = 0.0005;
    request.clock.method = storage::ReferenceClock::offset;
  }

  // A camera whose clock says 0 at `zero_s` of the run, from_s to to_s of the run.
  void see(double zero_s, double zero_m, double from_s = 0.1, double to_s = 29.9) {
    request.csv = "# made by hand\nt_s,x,position_m\n";
    for (double at_s = from_s; at_s < to_s; at_s += 1.0 / 30) {
      request.csv += fmt::format("{:.6f},9,{:.6f}\n", at_s - zero_s, truth_m(at_s) + zero_m);
    }
  }
  analysis::PlacedReference place() {
    auto placed = place_reference(request, own, zeroings, marker);
    if (!placed) throw std::runtime_error{placed.error().detail};
    return std::move(*placed);
  }
  Error refusal() {
    const auto placed = place_reference(request, own, zeroings, marker);
    return placed ? Error{} : placed.error();
  }
  // How far the worst position is from the truth.
  static double worst_m(const analysis::PlacedReference& placed) {
    double worst = 0;
    for (std::size_t i = 0; i < placed.positions.size(); ++i) {
      const double at_s = 1e-6 * static_cast<double>(placed.positions.robot_time_us[i] - 5'000'000);
      worst = std::max(worst, std::abs(placed.positions.position_m[i] - truth_m(at_s)));
    }
    return worst;
  }

  std::vector<analysis::OwnPosition> own;
  std::vector<storage::Zeroing> zeroings;
  analysis::ReferenceRequest request;
  std::optional<storage::MarkerPlace> marker;
};

TEST_F(ReferenceImportTest, ASpanInWhichTheRobotWasZeroedIsRefused) {
  see(0, 0);
  for (std::size_t k = 1500; k < own.size(); ++k) {
    own[k].position_m -= 0.1F;
    own[k].position_sd_m = 0;
  }
  EXPECT_EQ(refusal().reason, "zeroed");
  EXPECT_THAT(refusal().detail, HasSubstr("15.00 s"));
}

// Its standard deviation shows no zeroing of a robot that knows its position.
TEST_F(ReferenceImportTest, ASpanWithAnEventOfAZeroingIsRefusedHoweverSureTheRobotIs) {
  see(0, 0);
  for (analysis::OwnPosition& sample : own) sample.position_sd_m = 0;
  zeroings = {{0, 5'000'000}, {0, 35'000'001}, {1, 20'000'000}};  // before, after, and of another boot
  EXPECT_EQ(refusal().detail, "");
  zeroings.push_back({0, 20'000'000});
  EXPECT_EQ(refusal().reason, "zeroed");
  EXPECT_THAT(refusal().detail, HasSubstr("15.00 s"));
}

TEST_F(ReferenceImportTest, MillimetresAndCentimetresAreRefusedWhateverTheClockComesFrom) {
  const auto see_scaled = [this](double scale) {
    request.csv = "t_s,position_m\n";
    for (double at_s = 0.1; at_s < 29.9; at_s += 1.0 / 30) {
      request.csv += fmt::format("{:.6f},{:.6f}\n", at_s, scale * truth_m(at_s));
    }
  };
  request.clock.zero_at_us = 1'767'225'600'000'000;
  marker = storage::MarkerPlace{0, 5'000'000};
  for (const auto method : {storage::ReferenceClock::offset, storage::ReferenceClock::utc,
                            storage::ReferenceClock::marker, storage::ReferenceClock::correlation}) {
    request.clock.method = method;
    for (const bool keeps_zero : {false, true}) {
      request.keeps_zero = keeps_zero;
      see_scaled(1);
      EXPECT_EQ(refusal().detail, "") << text(method);
      see_scaled(1000);
      EXPECT_EQ(refusal().reason, "out_of_range") << text(method);
      EXPECT_THAT(refusal().detail, HasSubstr("they look like millimetres; if they are, divide position_m"))
          << text(method);
      see_scaled(100);
      EXPECT_THAT(refusal().detail, HasSubstr("centimetres")) << text(method);
      request.is_in_metres = true;
      EXPECT_EQ(refusal().detail, "") << text(method);
      request.is_in_metres = false;
    }
  }
}

// What carries the robot along unseen makes no other unit.
TEST_F(ReferenceImportTest, ARobotThatMissedMostOfItsMotionHasAReferenceAllTheSame) {
  see(0, 0);
  for (analysis::OwnPosition& sample : own) sample.position_m *= 0.02F;
  EXPECT_EQ(refusal().detail, "");
}

// A pump's flow, of which a robot feels nothing, as it holds a believed position.
TEST_F(ReferenceImportTest, ASteadyFlowOfMetresMakesNoOtherUnit) {
  for (analysis::OwnPosition& sample : own) sample.position_m *= 0.25F;
  request.csv = "t_s,position_m\n";
  for (double at_s = 0.1; at_s < 29.9; at_s += 1.0 / 30) {
    request.csv += fmt::format("{:.6f},{:.6f}\n", at_s, truth_m(at_s) + 0.1 * at_s);
  }
  request.clock.zero_at_us = 1'767'225'600'000'000;
  marker = storage::MarkerPlace{0, 5'000'000};
  for (const auto method :
       {storage::ReferenceClock::offset, storage::ReferenceClock::utc, storage::ReferenceClock::marker}) {
    request.clock.method = method;
    EXPECT_EQ(refusal().detail, "") << text(method);
  }
  request.clock.method = storage::ReferenceClock::correlation;
  EXPECT_EQ(refusal().reason, "no_correlation") << "the motions differ too much to find the clock, whatever the unit";
}

TEST_F(ReferenceImportTest, AnSdThatNoPositionHasIsRefusedWithItsLine) {
  for (const char* sd_m : {"0", "1e-160", "9e-8", "2e6"}) {
    request.csv = "t_s,position_m,position_sd_m\n";
    for (int k = 0; k < 20; ++k) request.csv += fmt::format("{},{},{}\n", k, 0.01 * k, k == 3 ? sd_m : "0.001");
    EXPECT_EQ(refusal().reason, "malformed_csv") << sd_m;
    EXPECT_THAT(refusal().detail, StartsWith("camera.csv line 5: position_sd_m ")) << sd_m;
  }
}

TEST_F(ReferenceImportTest, ANameOfSeveralLinesIsRefused) {
  see(0, 0);
  request.source = "camera\n0,9,0.001";
  EXPECT_EQ(refusal().reason, "out_of_range");
}

TEST_F(ReferenceImportTest, AnOffsetIsAddedAndTheZeroIsTheRobots) {
  see(-3, 0.7);
  request.clock.offset_s = -3;
  request.clock.sd_s = 0.02;
  const analysis::PlacedReference placed = place();
  EXPECT_EQ(placed.reference.clock_offset_s, -3);
  EXPECT_EQ(placed.reference.clock_sd_s, 0.02);
  EXPECT_NEAR(placed.reference.zero_offset_m, -0.7, 1e-6);
  EXPECT_NEAR(placed.reference.zero_sd_m.value(), 0.002, 1e-4);
  EXPECT_LT(worst_m(placed), 1e-5);
  EXPECT_EQ(placed.positions.position_sd_m.front(), 0.0005);
  EXPECT_EQ(placed.reference.samples, placed.positions.size());
  EXPECT_EQ(placed.reference.samples_left_out, 0U);
  EXPECT_THAT(analysis::clock_in_words(placed.reference), HasSubstr("t_s plus -3.0000 s ± 40 ms"));
  EXPECT_THAT(analysis::zero_in_words(placed.reference), StartsWith("zero by the robot's own record: -0.7000 m"));
}

TEST_F(ReferenceImportTest, AKeptZeroIsLeftAlone) {
  see(0, 0.7);
  request.keeps_zero = true;
  const analysis::PlacedReference placed = place();
  EXPECT_EQ(placed.reference.zero_offset_m, 0);
  EXPECT_FALSE(placed.reference.zero_sd_m);
  EXPECT_NEAR(placed.positions.position_m.front(), truth_m(0.1) + 0.7, 1e-5);
}

// While the robot is sure of its position it says where zero is, however wrong it is later.
TEST_F(ReferenceImportTest, TheZeroIsFoundWhereTheRobotIsSure) {
  for (std::size_t k = 300; k < own.size(); ++k) {
    own[k].position_m += 0.05F;
    own[k].position_sd_m = 0.05F;
  }
  see(0, 0.7);
  EXPECT_NEAR(place().reference.zero_offset_m, -0.7, 1e-3);
}

TEST_F(ReferenceImportTest, AMarkerTiesBothClocks) {
  see(2, 0);
  marker = storage::MarkerPlace{0, 5'000'000 + 6'500'000};
  request.clock.method = storage::ReferenceClock::marker;
  request.clock.at_s = 4.5;
  EXPECT_NEAR(place().reference.clock_offset_s, 2, 1e-9);
  EXPECT_LT(worst_m(place()), 1e-5);
  marker->span = 3;
  EXPECT_THAT(refusal().detail, HasSubstr("no samples in span 3"));
}

TEST_F(ReferenceImportTest, UtcGoesByTheClockThatTheStationKnew) {
  see(-1.25, 0);
  request.clock.method = storage::ReferenceClock::utc;
  request.clock.zero_at_us = 1'767'225'600'000'000 - 1'250'000;
  own.front().utc_us += 900'000;  // a guess of the first second
  own.front().clock_uncertainty_us = 900'000;
  const analysis::PlacedReference placed = place();
  EXPECT_NEAR(placed.reference.clock_offset_s, -1.25, 1e-9);
  EXPECT_NEAR(placed.reference.clock_sd_s.value(), 600e-6 / std::sqrt(3.0), 1e-9);
  for (std::size_t k = 0; k < own.size(); ++k) own[k].utc_us += static_cast<std::int64_t>(2 * k);  // 200 ppm
  EXPECT_GT(place().reference.clock_sd_s.value(), 0.003) << "one offset does not hold from end to end";
  for (analysis::OwnPosition& sample : own) sample.clock_uncertainty_us = -1;
  EXPECT_EQ(refusal().reason, "no_clock");
}

TEST_F(ReferenceImportTest, CorrelationFindsTheClockAndSaysHow) {
  see(100.123, -0.4);
  request.clock.method = storage::ReferenceClock::correlation;
  const analysis::PlacedReference placed = place();
  EXPECT_NEAR(placed.reference.clock_offset_s, 100.123, 1e-3);
  EXPECT_GT(placed.reference.correlation.value(), 0.99);
  EXPECT_LT(worst_m(placed), 1e-3);
  EXPECT_THAT(analysis::clock_in_words(placed.reference),
              StartsWith("clock by correlation with the robot's own motion"));
  for (analysis::OwnPosition& sample : own) sample.position_m = 0;
  EXPECT_EQ(refusal().reason, "no_correlation");
  EXPECT_THAT(refusal().detail, HasSubstr("the robot moves by at most 0 mm"));
}

TEST_F(ReferenceImportTest, RowsBeforeAndAfterTheSpanAreLeftOut) {
  see(0, 0, -2, 33);
  const analysis::PlacedReference placed = place();
  EXPECT_GE(placed.positions.robot_time_us.front(), 5'000'000U);
  EXPECT_LE(placed.positions.robot_time_us.back(), 35'000'000U);
  EXPECT_GT(placed.reference.samples_left_out, 100U);
  request.clock.offset_s = 50;
  EXPECT_EQ(refusal().reason, "not_in_run");
}

TEST_F(ReferenceImportTest, WhatIsWrongIsReportedWithItsLine) {
  request.csv = "# remark\nt_s,position_m\n0,0.1\n0.1,x\n";
  EXPECT_EQ(refusal().detail, "camera.csv line 4: 'x' in column position_m is not a finite number");
  request.csv = "t_s,position_m\n0,0.1\n\n0.1,0.1\n0.1,0.2\n";
  EXPECT_EQ(refusal().detail, "camera.csv line 5: t_s 0.1 is not after 0.1, the one before: times must ascend");
  request.csv = "t_s,position_m,position_sd_m\n0,0.1,0.001\n0.1,0.1,0\n";
  EXPECT_EQ(refusal().detail, "camera.csv line 3: position_sd_m 0 is not from 1e-07 to 1e+06 m");
  request.csv = "t_s,y\n0,0.1\n";
  EXPECT_THAT(refusal().detail, HasSubstr("column position_m is missing"));
  request.csv = "t_s,position_m\n0,0.1\n";
  request.sd_m.reset();
  EXPECT_EQ(refusal().reason, "no_sd");
}

TEST_F(ReferenceImportTest, ARunWithARebootNeedsASpan) {
  see(0, 0);
  for (int k = 0; k < 100; ++k) {
    analysis::OwnPosition sample = own.front();
    sample.span = 1;
    sample.robot_time_us += static_cast<std::uint64_t>(k) * 10'000;
    own.push_back(sample);
  }
  EXPECT_EQ(refusal().reason, "several_spans");
  request.span = 0;
  EXPECT_EQ(place().reference.span, 0U);
}

TEST_F(ReferenceImportTest, TheDisturbanceIsNoMotion) {
  storage::StoredSample stored;
  stored.sample.position_m = 0.15F;
  stored.disturbance_m = 0.05F;
  EXPECT_FLOAT_EQ(analysis::own_position(stored).position_m, 0.1F);
}

}  // namespace
}  // namespace server
