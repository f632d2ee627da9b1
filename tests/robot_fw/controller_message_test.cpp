// Which controllers the robot runs, and that it gives them back as it got them.
#include "robot_fw/core/controller_message.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/robot_fw/controllers.hpp"

namespace robot_fw {
namespace {

constexpr DutyRange kMotor{-1, 1};

std::string fault(const protocol::Controller& controller, DutyRange motor = kMotor) {
  return protocol::text(fault_of(controller, motor, 10'000));
}

TEST(ControllerMessage, TheGoldenControllersCarryTheirChecksumAndAreSound) {
  for (const auto& controller : {paper_controller(), biquad_controller()}) {
    EXPECT_EQ(checksum_of(controller), controller.checksum);
    EXPECT_EQ(fault(controller), "none");
  }
}

TEST(ControllerMessage, ComesBackAsItWent) {
  for (const auto& sent : {paper_controller(), biquad_controller()}) {
    protocol::Controller back;
    write_controller(sections_of(sent), 10'000, back);
    EXPECT_EQ(checksum_of(back), sent.checksum);
    EXPECT_EQ(back.checksum, sent.checksum);
    EXPECT_EQ(back.controller_id, sent.controller_id);
  }
}

TEST(ControllerMessage, EveryCoefficientCountsInTheChecksum) {
  protocol::Controller controller = biquad_controller();
  for (float* number : {&controller.kp, &controller.direct, &controller.pole[0], &controller.residue[0],
                        &controller.biquad_b0[0], &controller.biquad_b1[0], &controller.biquad_a1[0],
                        &controller.biquad_a2[0], &controller.duty_min, &controller.duty_max}) {
    const float before = *number;
    *number = std::nextafter(before, -1e9F);
    EXPECT_EQ(fault(controller), "checksum");
    *number = before;
  }
  controller.period_us = 10'001;
  EXPECT_EQ(fault(controller), "checksum");
}

TEST(ControllerMessage, RefusesUnevenColumnsNoIdAndAnUnknownDerivative) {
  auto uneven = paper_controller(), nameless = paper_controller(), strange = paper_controller();
  uneven.residue_count = 4;
  nameless.controller_id = 0;
  strange.derivative_on = static_cast<rheonaut_DerivativeOn>(2);
  for (const auto& controller : {uneven, nameless, strange}) EXPECT_EQ(fault(with_checksum(controller)), "malformed");
  for (auto count : {&protocol::Controller::biquad_b0_count, &protocol::Controller::biquad_b1_count,
                     &protocol::Controller::biquad_a1_count, &protocol::Controller::biquad_a2_count}) {
    auto controller = biquad_controller();
    controller.*count = 0;
    EXPECT_EQ(fault(with_checksum(controller)), "malformed");
  }
}

TEST(ControllerMessage, RefusesWhatIsNotFinite) {
  protocol::Controller controller = biquad_controller();
  for (float* number : {&controller.kp, &controller.direct, &controller.pole[0], &controller.residue[0],
                        &controller.biquad_b0[0], &controller.biquad_b1[0], &controller.biquad_a1[0],
                        &controller.biquad_a2[0], &controller.duty_min, &controller.duty_max}) {
    const float before = *number;
    for (const float value : {std::nanf(""), INFINITY, -INFINITY}) {
      *number = value;
      EXPECT_EQ(fault(with_checksum(controller)), "not_finite");
    }
    *number = before;
  }
}

TEST(ControllerMessage, RefusesAGainAtDcThatIsNotFinite) {
  protocol::Controller controller = paper_controller();
  controller.residue[0] = 3e38F;
  controller.pole[0] = 0.9F;
  EXPECT_EQ(fault(with_checksum(controller)), "not_finite");
}

TEST(ControllerMessage, RefusesUnstablePoles) {
  for (const float pole : {1.0F, -1.0F, 1.0001F, -7.0F}) {
    protocol::Controller controller = paper_controller();
    controller.pole[2] = pole;
    EXPECT_EQ(fault(with_checksum(controller)), "unstable") << pole;
  }
}

TEST(ControllerMessage, RefusesBiquadsOutsideTheTriangle) {
  const std::pair<float, float> outside[] = {{0, 1}, {0, -1}, {1.5F, 0.5F}, {-1.5F, 0.5F}, {2.1F, 0.9F}, {0.2F, -0.9F}};
  for (const auto& [a1, a2] : outside) {
    protocol::Controller controller = biquad_controller();
    controller.biquad_a1[0] = a1;
    controller.biquad_a2[0] = a2;
    EXPECT_EQ(fault(with_checksum(controller)), "unstable") << a1 << ' ' << a2;
  }
}

TEST(ControllerMessage, RefusesADutyRangeBeyondTheMotorOr0) {
  const DutyRange beyond[] = {{-1, 0.7F}, {-0.4F, 1}, {0.1F, 0.5F}, {-0.3F, 0}, {-0.3F, -0.1F}};
  for (const DutyRange& range : beyond) {
    protocol::Controller controller = paper_controller();
    controller.duty_min = range.min;
    controller.duty_max = range.max;
    EXPECT_EQ(fault(with_checksum(controller), {-0.3F, 0.6F}), "out_of_range") << range.min << ' ' << range.max;
  }
}

TEST(ControllerMessage, RefusesAnotherPeriodAGainOf0AndTooManySections) {
  auto slow = paper_controller(), inverse = paper_controller(), off = paper_controller(), large = biquad_controller();
  slow.period_us = 20'000;
  inverse.kp = -1;
  off.kp = 0;
  set_column(large.pole, large.pole_count, {0, 0, 0, 0, 0, 0, 0, 0, 0});
  set_column(large.residue, large.residue_count, {0, 0, 0, 0, 0, 0, 0, 0, 0});
  for (const auto& each : {slow, inverse, off, large}) EXPECT_EQ(fault(with_checksum(each)), "out_of_range");
  large.pole_count = large.residue_count = 8;  // and a biquad is 10
  EXPECT_EQ(fault(with_checksum(large)), "none");
}

TEST(ControllerMessage, TheBuiltInControllerFitsEveryMotor) {
  for (const DutyRange& motor : {DutyRange{-1, 1}, DutyRange{0, 1}, DutyRange{-0.2F, 0.6F}}) {
    protocol::Controller controller;
    write_controller(adapted(kPaperController, motor, 10'000), 10'000, controller);
    EXPECT_EQ(fault(controller, motor), "none");
  }
}

}  // namespace
}  // namespace robot_fw
