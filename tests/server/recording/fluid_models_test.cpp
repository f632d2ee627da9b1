// Models of fluids on disk: the newest is in force, over restarts, with every number as it was given.
#include "server/storage/runs/fluid_models.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "tests/server/recording/recording_test.hpp"

namespace server {
namespace {

using ::testing::ElementsAre;

class FluidModelsTest : public RecordingTest {
 protected:
  // Numbers that no short decimal gives back.
  static station::FluidModel model_of(float gain) {
    station::FluidModel model;
    model.gain_m_s = {gain, -1.0F / 3, std::numeric_limits<float>::denorm_min(), 0};
    model.time_constant_s = {0.001F, 1.0F / 7, 3.14159265F, 1000};
    model.fit_error = 0.1 / 30;
    model.document = R"({"plant":{"kp":0.13}})";
    return model;
  }
  storage::FluidModels& models() { return recording_->fluid_models; }
  const station::FluidModel* in_force(const std::string& fluid) { return models().in_force().find(fluid); }
  Result<station::FluidModel> set(const std::string& fluid, const station::FluidModel& model) {
    return wait(models().set(fluid, model, {"user:anna/session:4", "10.0.0.7", 0}));
  }
};

TEST_F(FluidModelsTest, TheNewestIsInForceOverARestartBitForBit) {
  start();
  EXPECT_EQ(in_force("water"), nullptr);
  ASSERT_TRUE(set("water", model_of(9)));
  ASSERT_TRUE(set("water", model_of(0.1F)));
  ASSERT_TRUE(set("oil", model_of(2)));
  const station::FluidModel water = *in_force("water");
  EXPECT_EQ(water.set_by, "user:anna/session:4");
  EXPECT_GT(water.set_at_us, 0);
  kill();
  start();
  ASSERT_NE(in_force("water"), nullptr) << "it was on disk before the answer";
  EXPECT_EQ(*in_force("water"), water);
  EXPECT_EQ(in_force("oil")->gain_m_s[0], 2);
  EXPECT_EQ(number("SELECT count(*) FROM fluid_model"), 3) << "what was in force before stays in the record";
  stop();
}

TEST_F(FluidModelsTest, OneThatIsRemovedStaysRemoved) {
  start();
  ASSERT_TRUE(set("water", model_of(1)));
  EXPECT_TRUE(wait(models().remove("water", {"token:local", "", 0})));
  EXPECT_EQ(in_force("water"), nullptr);
  EXPECT_EQ(wait(models().remove("water", {"token:local", "", 0})).error().reason, "no_model");
  stop();
  start();
  EXPECT_EQ(in_force("water"), nullptr);
  ASSERT_TRUE(set("water", model_of(3)));
  EXPECT_EQ(in_force("water")->gain_m_s[0], 3);
  EXPECT_THAT(rows("SELECT action, subject, actor FROM audit WHERE action LIKE 'fluid.%' ORDER BY entry"),
              ElementsAre("fluid.model_set|water|user:anna/session:4", "fluid.model_removed|water|token:local",
                          "fluid.model_set|water|user:anna/session:4"));
  stop();
}

}  // namespace
}  // namespace server
