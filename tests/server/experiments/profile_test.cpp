// Profiles as documents: what is read, what is refused and where, and those that come with the program.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>

#include "base/field_list.hpp"
#include "server/experiments/profile_document.hpp"
#include "server/experiments/three_tones_document.hpp"
#include "server/experiments/time_line.hpp"

namespace server::experiments {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr const char* kHead = "name = \"n\"\npurpose = \"p\"\n";

std::string error_of(const std::string& text) {
  try {
    parse_profile(kHead + text, "mine.toml");
    return "none";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

constexpr const char* kUntil = "until = \"sigma(alpha) <= 0.02\"\n";
constexpr const char* kDuty = "[[step]]\nkind = \"duty\"\nduty = 0.4\nfor_s = 3\n";
constexpr const char* kLonger = "[[step]]\nkind = \"duty\"\nduty = 0.2\nfor_s = 5\n";

TEST(Profile, WithUntilItsStepsAreAChoice) {
  const std::string text =
      std::string{kHead} + kUntil + "most_runs = 3\n[sweep]\nduty_factor = [1, -0.5]\n" + kDuty + kLonger;
  const Profile profile = parse_profile(text, "mine.toml");
  ASSERT_TRUE(profile.until);
  EXPECT_EQ(profile.until->parameter, 3U);
  EXPECT_EQ(profile.until->sigma, 0.02);
  EXPECT_EQ(profile.most_runs, 3U);
  const std::vector<Variant> choices = variants_of(profile);
  ASSERT_EQ(choices.size(), 4U);
  EXPECT_EQ(choices[3].step, 2U);
  const TimeLine line = time_line_of(profile, choices[3]);
  EXPECT_EQ(line.step_begins.size(), 1U);
  EXPECT_EQ(line.actions.front().value, -0.1);
  EXPECT_DOUBLE_EQ(line.duration_s(), 5);
  EXPECT_DOUBLE_EQ(longest_duration_s(profile), 5) << "a run performs one of them";
}

TEST(Profile, AnUntilThatCannotBeIsRefused) {
  const std::string target = "until = \"sigma(gamma) <= 0.02\"\n";
  EXPECT_THAT(error_of(target + kDuty), HasSubstr("it must be like sigma(alpha) <= 0.02"));
  for (const char* sigma : {"0", "-1", "inf", "0.02 ", "", "1e999"}) {
    EXPECT_THAT(error_of(std::string{"until = \"sigma(alpha) <= "} + sigma + "\"\n" + kDuty),
                HasSubstr("it must be like"))
        << sigma;
  }
  EXPECT_THAT(error_of(std::string{kUntil} + "most_runs = 9\n" + kDuty), HasSubstr("most_runs"));
  EXPECT_THAT(error_of(std::string{kUntil} + "[sweep]\nrepeats = 2\n" + kDuty), HasSubstr("duty_factor only"));
  EXPECT_THAT(error_of(std::string{kUntil} + "[[step]]\nkind = \"rest\"\nfor_s = 3\n"),
              AllOf(HasSubstr("mine.toml:5"), HasSubstr("kind is rest"), HasSubstr("prbs")));
  EXPECT_THAT(error_of(std::string{kUntil} + "[[step]]\nkind = \"setpoint\"\nsetpoint_m = 0.1\nfor_s = 3\n"),
              HasSubstr("kind is setpoint"));
}

// What could only fail after the robot was driven for long is refused before.
TEST(Profile, AnUntilThatNoFitCouldTakeIsRefused) {
  const std::string until{kUntil};
  EXPECT_THAT(error_of(until + "[limits]\nduration_max_s = 600\n[[step]]\nkind = \"duty\"\nduty = 0.01\nfor_s = 600\n"),
              HasSubstr("one fit takes 200000"));
  EXPECT_THAT(error_of(until + "[[step]]\nkind = \"duty\"\nduty = 0\nfor_s = 3\n"), HasSubstr("moves the robot"));
  EXPECT_THAT(error_of(until + "[[step]]\nkind = \"duty\"\nduty = 0.1\nfor_s = 0.1\n"), HasSubstr("at least 0.2 s"));
  EXPECT_THAT(error_of(until + "[sweep]\nduty_factor = [1, 0]\n" + kDuty), HasSubstr("duty_factor has 0"));
  EXPECT_THAT(error_of(until + "[conditions]\nstart = \"here\"\n" + kDuty), HasSubstr("start is here"));
  std::string many = until;
  for (int i = 0; i < 51; ++i) many += kDuty;
  EXPECT_THAT(error_of(many), HasSubstr("51 choices, allowed are 50"));
}

TEST(Profile, HasWhatItsDocumentSays) {
  const Profile profile = parse_profile(R"(
name = "Mine"
purpose = "To see."
[conditions]
fluid = "water"
pump = "pulse_70_bpm"
mean_flow_m_s = 0.02
[limits]
position_max_m = 0.5
duty_max = 0.4
[abort]
gap_s = 0.5
sensor_fault = false
[sweep]
duty_factor = [0.5, -1]
controllers = ["a", "b"]
repeats = 2
[[step]]
kind = "duty"
duty = 0.4
for_s = 3
)",
                                        "mine.toml");
  EXPECT_EQ(profile.name, "Mine");
  EXPECT_EQ(profile.conditions.fluid, "water");
  EXPECT_EQ(profile.conditions.pump, PumpFlow::pulse_70_bpm);
  EXPECT_EQ(profile.conditions.mean_flow_m_s, 0.02);
  EXPECT_EQ(profile.limits.position_max_m, 0.5);
  EXPECT_EQ(profile.limits.position_min_m, -1) << "the default";
  EXPECT_EQ(profile.abort.gap_s, 0.5);
  EXPECT_FALSE(profile.abort.sensor_fault);
  ASSERT_EQ(profile.steps.size(), 1U);
  EXPECT_EQ(profile.steps[0].duty, 0.4);
  const std::vector<Variant> variants = variants_of(profile);
  ASSERT_EQ(variants.size(), 8U);
  EXPECT_EQ(variants[0].fluid, "water");
  EXPECT_EQ(variants[0].controller, "a");
  EXPECT_EQ(variants[0].duty_factor, 0.5);
  EXPECT_EQ(variants[1].repeat, 2U) << "repeats follow each other";
  EXPECT_EQ(variants[2].duty_factor, -1);
  EXPECT_EQ(variants[4].controller, "b");
}

TEST(Profile, EveryErrorNamesTheLineTheKeyAndWhatIsAllowed) {
  EXPECT_THAT(error_of(""), HasSubstr("there is no [[step]]"));
  EXPECT_THAT(error_of("[[step]]\nkind = \"stairs\"\nfor_s = 1"),
              AllOf(StartsWith("mine.toml:4:"), HasSubstr("there is no 'stairs'"), HasSubstr("staircase")));
  EXPECT_THAT(error_of("[[step]]\nkind = \"duty\"\nduty = 2\nfor_s = 1"),
              AllOf(StartsWith("mine.toml:5:"), HasSubstr("step[0].duty: is 2, allowed is -1 to 1")));
  EXPECT_THAT(error_of("[[step]]\nkind = \"duty\"\nfor_s = 1"), HasSubstr("duty: must be given"));
  EXPECT_THAT(error_of("[[step]]\nkind = \"rest\"\nfor_s = 1\nduty = 0.2"), HasSubstr("duty: is no key here"));
  EXPECT_THAT(error_of("[[step]]\nkind = \"chirp\"\nfor_s = 9\namplitude = 0.5\nfrom_hz = 2\nto_hz = 1"),
              AllOf(StartsWith("mine.toml:7:"), HasSubstr("to_hz is 1, it must be above from_hz, which is 2")));
  EXPECT_THAT(error_of("[[step]]\nkind = \"chirp\"\nfor_s = 9\namplitude = 0.5\nfrom_hz = 1\nto_hz = 10"),
              HasSubstr("every_s is 0.05, at most a quarter of a period of to_hz is allowed: 0.025"));
  EXPECT_THAT(error_of("[[step]]\nkind = \"multisine\"\nfor_s = 9\namplitude = 0.5\nfrom_hz = 0.1\nto_hz = 1"),
              HasSubstr("for_s is 9, at least one period of from_hz is needed: 10"));
  EXPECT_THAT(error_of("[conditions]\nmean_flow_m_s = 0.1\n[[step]]\nkind = \"rest\"\nfor_s = 1"),
              AllOf(StartsWith("mine.toml:4:"), HasSubstr("but pump is off")));
  EXPECT_THAT(error_of("[limits]\nposition_min_m = 1\nposition_max_m = 0\n[[step]]\nkind = \"rest\"\nfor_s = 1"),
              HasSubstr("it must be above position_min_m, which is 1"));
  EXPECT_THAT(error_of("[sweep]\nduty_factor = [0.5, \"1\"]\n[[step]]\nkind = \"rest\"\nfor_s = 1"),
              HasSubstr("sweep.duty_factor[1]: must be a number"));
  EXPECT_THAT(error_of("[sweep]\nfluids = \"water\"\n[[step]]\nkind = \"rest\"\nfor_s = 1"),
              HasSubstr("must be a list such as [\"water\"]"));
  EXPECT_THAT(error_of("[sweep]\nfluids = [\"\"]\n[[step]]\nkind = \"rest\"\nfor_s = 1"), HasSubstr("not empty"));
  EXPECT_THAT(error_of("[sweep]\nrepeats = 600\nduty_factor = [1, 0.5]\n[[step]]\nkind = \"rest\"\nfor_s = 1"),
              HasSubstr("the sweep has 1200 runs with its repeats, allowed are 1000"));
  EXPECT_THAT(error_of("[[step]\n"), StartsWith("mine.toml:3:"));
}

// SAFETY: what goes beyond the profile's own limits is refused when it is read, also where only a factor takes it
// there.
TEST(Profile, AStepBeyondItsLimitsIsRefusedAtItsPlace) {
  const std::string rest = "[[step]]\nkind = \"rest\"\nfor_s = 1\n";
  const std::string duty = "[[step]]\nkind = \"duty\"\nduty = -0.4\nfor_s = 1\n";
  EXPECT_THAT(error_of("[limits]\nduty_max = 0.3\n" + rest + duty),
              AllOf(StartsWith("mine.toml:10:"), HasSubstr("the duty reaches -0.4, limits.duty_max is 0.3")));
  EXPECT_EQ(error_of("[limits]\nduty_max = 0.3\n[sweep]\nduty_factor = [0.5]\n" + duty), "none");
  const std::string setpoint = "[[step]]\nkind = \"setpoint\"\nsetpoint_m = 0.3\nfor_s = 1\n";
  EXPECT_EQ(error_of("[limits]\nposition_max_m = 0.5\n" + setpoint), "none");
  EXPECT_THAT(error_of("[limits]\nposition_max_m = 0.5\n[sweep]\nsetpoint_factor = [1, 2]\n" + setpoint),
              HasSubstr("setpoint_m is 0.3, times the setpoint_factor 2; the limits of the profile allow -1 to 0.5"));
  EXPECT_THAT(error_of("[limits]\nduration_max_s = 1.5\n" + rest + rest),
              HasSubstr("with this step and its for_s a run takes 2 s, limits.duration_max_s is 1.5"));
  EXPECT_THAT(
      error_of("[limits]\nduration_max_s = 5\n[[step]]\nkind = \"scan\"\nsetpoint_m = 0.6\nvelocity_m_s = 0.1\n"),
      HasSubstr("takes 6.5 s"));
}

TEST(Profile, TonesNeedAWholeWindowAndRoomForTheirSum) {
  const auto tones = [](const std::string& more) {
    return "[[step]]\nkind = \"tones\"\nsetpoint_m = 0\namplitude_m = 0.1\ncrossover_rad_s = 4\n" + more;
  };
  EXPECT_EQ(error_of(tones("for_s = 20\n")), "none");
  EXPECT_THAT(error_of(tones("for_s = 15\n")), HasSubstr("for_s is 15, one period of a tenth of crossover_rad_s"));
  EXPECT_THAT(error_of(tones("for_s = 20\nevery_s = 0.3\n")), HasSubstr("every_s is 0.3, at most a quarter"));
  EXPECT_THAT(
      error_of("[limits]\nposition_max_m = 0.25\n" + tones("for_s = 20\n")),
      HasSubstr("setpoint_m is 0, and three sines of 0.1 about it; the limits of the profile allow -1 to 0.25"));
}

TEST(Profile, TheDocumentOfThreeTonesIsSoundAtEveryCrossover) {
  for (const double crossover_rad_s : {0.2, 0.5, 1.0, 4.0, 20.0}) {
    const auto profile = parse_profile(three_tones_document(crossover_rad_s, 0.02).dump(), "tones");
    EXPECT_EQ(profile.steps.at(0).crossover_rad_s, crossover_rad_s);
    if (crossover_rad_s >= 0.6) EXPECT_LE(longest_duration_s(profile), 120) << crossover_rad_s;
  }
}

TEST(Profile, ThoseOfTheProgramAreSound) {
  ASSERT_EQ(shipped_profiles().size(), 11U);
  for (const base::EmbeddedFile& shipped : shipped_profiles()) {
    const Profile profile = find_profile(std::string(shipped.name));
    EXPECT_FALSE(variants_of(profile).empty()) << shipped.name;
    EXPECT_LE(longest_duration_s(profile), 300) << shipped.name;
  }
  EXPECT_EQ(variants_of(find_profile("figure_8")).size(), 2U);
  EXPECT_THROW(find_profile("figure_6"), std::invalid_argument);
}

TEST(Profile, ItsKeysCanBeListed) {
  Profile profile;
  base::FieldList list;
  fields(list, profile);
  const auto find = [&](const std::string& key) { return *std::ranges::find(list.fields, key, &base::Field::key); };
  EXPECT_EQ(find("sweep.duty_factor").allowed(), "a list of numbers, -1 to 1");
  EXPECT_EQ(find("sweep.fluids").allowed(), "a list of texts");
  EXPECT_EQ(find("sweep.fluids").value_text(), "none");
  EXPECT_THAT(find("step[].kind").allowed(), HasSubstr("multisine"));
}

TEST(Profile, TheDocumentHoldsTheParsersOwnTables) {
  std::ifstream file{std::string(TEST_DATA_DIR) + "/../../docs/experiments.md"};
  std::ostringstream document;
  document << file.rdbuf();
  std::istringstream tables{profile_tables()};
  for (std::string line; std::getline(tables, line);) {
    EXPECT_THAT(document.str(), HasSubstr(line + "\n")) << "from rheonaut profile --keys";
  }
}

}  // namespace
}  // namespace server::experiments
