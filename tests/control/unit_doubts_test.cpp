// Values that look like another unit are named, with the value and what to do; those of a robot are not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "control/identification/unit_doubts.hpp"
#include "recorded_runs.hpp"

namespace control {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Recording run() { return position_run(kNonNewtonianModel, prbs_duty(0.6, 0.2, 5, 0.01), 1e-3, 2); }

TEST(UnitDoubts, AreNoneForARobot) {
  Recording recording = run();
  recording.velocity_m_s = output_of(kNewtonianModel, Channel::velocity, 0.01, recording.duty);
  EXPECT_THAT(unit_doubts(recording), IsEmpty());
}

TEST(UnitDoubts, NameAPositionInMillimetres) {
  Recording recording = run();
  for (double& x : recording.position_m) x *= 1000;
  EXPECT_THAT(unit_doubts(recording),
              ElementsAre(AllOf(HasSubstr("position_m moves at up to "), HasSubstr("in mm, divide it by 1000"))));
}

TEST(UnitDoubts, NameATimeInMilliseconds) {
  Recording recording = run();
  recording.dt_s *= 1000;
  EXPECT_THAT(unit_doubts(recording), ElementsAre(AllOf(HasSubstr("t_s steps by 10 s"), HasSubstr("in ms"))));
}

// Together the speed looks right.
TEST(UnitDoubts, NameMillimetresAndMillisecondsTogether) {
  Recording recording = run();
  recording.dt_s *= 1000;
  for (double& x : recording.position_m) x *= 1000;
  EXPECT_THAT(unit_doubts(recording), ElementsAre(HasSubstr("in ms"), HasSubstr("position_m spans ")));
}

TEST(UnitDoubts, NameADutyInPercentInTheWarningsOfAFit) {
  Recording recording = run();
  for (double& duty : recording.duty) duty *= 100;
  IdentificationOptions options = unhurried_options();
  options.structure = Structure::first_order;
  options.further_starts = 0;
  const auto warnings = identify(recording, options).warnings;
  ASSERT_FALSE(warnings.empty());
  EXPECT_THAT(warnings.front(), AllOf(HasSubstr("duty reaches 60"), HasSubstr("percent, divide it by 100")));
}

}  // namespace
}  // namespace control
