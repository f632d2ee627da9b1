// Models come as the tools print them, and nothing that is not a model gets in.
#include "sim_robot/scenario/model_file.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace sim_robot {
namespace {

constexpr const char* kNumbers = R"({"kp":0.2,"b1":0.01,"b2":0.3,"b3":2,"alpha":1.5,"beta":0.9})";

std::string refusal(const std::string& json) {
  try {
    parse_model(json);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

void expect_the_numbers(const std::string& json) {
  const control::FractionalModel model = parse_model(json).model;
  EXPECT_EQ(model.kp, 0.2);
  EXPECT_EQ(model.b1, 0.01);
  EXPECT_EQ(model.b2, 0.3);
  EXPECT_EQ(model.b3, 2);
  EXPECT_EQ(model.alpha, 1.5);
  EXPECT_EQ(model.beta, 0.9);
}

TEST(ModelFile, TakesAModelFile) { expect_the_numbers(kNumbers); }

TEST(ModelFile, TakesWhatIdentifyPrints) {
  expect_the_numbers(std::string(R"({"structure":"fractional","fit_percent":99.1,"parameters":)") + kNumbers + "}");
}

TEST(ModelFile, TakesAModelWithinAnObject) {
  expect_the_numbers(std::string(R"({"derived_numerator":3.5,"model":)") + kNumbers + "}");
}

TEST(ModelFile, PassesOverWhatTheToolsSayAboutAModel) {
  EXPECT_EQ(parse_model(R"({"name":"tank","kp":0.1,"b1":0,"b2":0.1,"alpha":2,"beta":1,"dc_gain_m_s":0.1})").model.b3,
            1);
}

TEST(ModelFile, TakesTheDeadTimeThatIdentifyFound) {
  const std::string identified = std::string(R"({"parameters":)") + kNumbers;
  EXPECT_EQ(parse_model(identified + R"(,"dead_time_s":0.03})").dead_time_s, 0.03);
  EXPECT_EQ(parse_model(identified + "}").dead_time_s, 0);
  EXPECT_EQ(refusal(identified + R"(,"dead_time_s":-1})"), "dead_time_s is -1, allowed is 0 to 10");
  std::string inside = kNumbers;
  inside.insert(inside.size() - 1, R"(,"dead_time_s":0.07)");
  EXPECT_EQ(parse_model(inside).dead_time_s, 0.07);
  EXPECT_EQ(parse_model(R"({"model":)" + inside + "}").dead_time_s, 0.07);
  EXPECT_EQ(parse_model(R"({"parameters":)" + inside + R"(,"dead_time_s":0.07})").dead_time_s, 0.07);
  EXPECT_EQ(refusal(R"({"parameters":)" + inside + R"(,"dead_time_s":0.03})"),
            "model: 'dead_time_s' is 0.07 in it and 0.03 beside it; leave one");
}

TEST(ModelFile, SaysWhatIsWrong) {
  EXPECT_EQ(refusal("{"), "model: this is not JSON");
  EXPECT_EQ(refusal("[1]"), "model: [1] is not an object with kp, b1, b2, …");
  EXPECT_EQ(refusal(R"({"kp":1})"), "model: 'b1' is missing");
  EXPECT_EQ(refusal(R"({"kp":"1"})"), "model: 'kp' must be a number, is \"1\"");
  EXPECT_EQ(refusal(R"({"gain":1})"), "model: there is no 'gain'; it has kp, b1, b2, b3, alpha, beta, dead_time_s");
  EXPECT_NE(refusal(R"({"kp":1,"b1":1,"b2":1,"alpha":0.5,"beta":0.9})"), "");  // alpha below beta
}

TEST(ModelFile, AFileThatIsNotThereIsSaidByItsName) {
  try {
    load_model("/nowhere/model.json");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "/nowhere/model.json: cannot be read: No such file or directory");
  }
}

}  // namespace
}  // namespace sim_robot
