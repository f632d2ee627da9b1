// What the tools say to files and flags that they cannot use: one sentence with the place, the value and what is
// allowed.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include "tests/server/cli/tool_test.hpp"

namespace server::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class BadInput : public ToolTest {
 protected:
  // The complaint about this text as a plant's file.
  std::string plant(const std::string& text) {
    save("m.json", text);
    return complaint("bode --plant @m.json");
  }
  std::string controller(const std::string& text) {
    save("c.json", text);
    return complaint("bode --controller @c.json");
  }
  std::string csv(const std::string& text) {
    save("run.csv", text);
    return complaint("identify --csv @run.csv");
  }
  std::string complaint(const std::string& command) {
    const Answer answer = ask(command);
    EXPECT_THAT(answer.exit_code, ::testing::AnyOf(1, 2)) << command;
    EXPECT_EQ(answer.text, "") << command;
    EXPECT_EQ(std::ranges::count(answer.error, '\n'), answer.exit_code - 1) << answer.error;  // 1: main ends the line
    return answer.error;
  }
};

TEST_F(BadInput, ModelFiles) {
  EXPECT_THAT(plant("{"), AllOf(HasSubstr("m.json: is not JSON"), HasSubstr("line 1, column 2")));
  EXPECT_THAT(plant(""), HasSubstr("is not JSON"));
  EXPECT_THAT(plant("[1]"), HasSubstr("an array is not a model"));
  EXPECT_THAT(plant(R"({"kp":1,"b1":1,"b2":1,"alpha":1.5})"), HasSubstr("key \"beta\" is missing"));
  EXPECT_THAT(plant(R"({"kp":1,"b1":1,"b2":1,"aplha":1.5,"beta":0.5})"),
              AllOf(HasSubstr("\"aplha\" = 1.5"), HasSubstr("kp, b1, b2, b3, alpha, beta")));
  EXPECT_THAT(plant(R"({"kp":"1","b1":1,"b2":1,"alpha":1.5,"beta":0.5})"), HasSubstr("key \"kp\" = \"1\""));
  EXPECT_THAT(plant(R"({"kp":1e999,"b1":1,"b2":1,"alpha":1.5,"beta":0.5})"), HasSubstr("m.json"));
  EXPECT_THAT(plant(R"({"kp":1,"b1":1,"b2":1,"alpha":2.5,"beta":0.5})"), AllOf(HasSubstr("alpha"), HasSubstr("2.5")));
  EXPECT_THAT(plant(R"({"parameters":{"kp":1}})"), HasSubstr("missing"));
  EXPECT_THAT(plant(std::string(400'000, '[') + std::string(400'000, ']')), HasSubstr("more than 64 deep"));
}

TEST_F(BadInput, FilesForAStationAreOfBoundedDepthAndSize) {
  save("deep.json", R"({"a":)" + std::string(200'000, '[') + std::string(200'000, ']') + "}");
  for (const char* command : {"job begin", "fluid model newtonian", "design save --kind model --name x"}) {
    EXPECT_THAT(complaint(fmt::format("{} @deep.json --data @.", command)), HasSubstr("more than 64 deep"));
    EXPECT_THAT(complaint(fmt::format("{} /dev/zero --data @.", command)), HasSubstr("has more than 1048576 bytes"));
  }
}

TEST_F(BadInput, AFileOfAnySizeIsBounded) {
  save("large", "name = \"x\"\n");
  std::filesystem::resize_file(folder_ / "large", std::uintmax_t{1} << 30);  // sparse
  EXPECT_THAT(complaint("profile @large"), HasSubstr("large' has more than 1048576 bytes: 1073741824"));
  EXPECT_THAT(complaint("check-config --config @large"), HasSubstr("has more than 1048576 bytes"));
  EXPECT_THAT(complaint("bode --plant @large"), HasSubstr("has more than 1048576 bytes"));
  EXPECT_THAT(complaint("identify --csv @large"), HasSubstr("has more than 536870912 bytes"));
  EXPECT_THAT(complaint("job begin @large --data @."), HasSubstr("has more than 1048576 bytes"));
}

// A pipe that nobody writes to would be waited for.
TEST_F(BadInput, AProfileOrConfigurationIsNoPipeAndNoDevice) {
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  for (const char* file : {"@pipe", "/dev/zero"}) {
    EXPECT_THAT(complaint(std::string{"profile "} + file), HasSubstr("there is no profile"));
    EXPECT_THAT(complaint(std::string{"check-config --config "} + file), HasSubstr("does not exist"));
  }
}

TEST_F(BadInput, ModelFilesMayHaveRemarksAndLackB3) {
  save("m.json",
       R"({"kp":0.1,"b1":0.005682,"b2":0.11031,"alpha":1.7263,"beta":0.8682,"comment":"eq. 29","name":"oil"})");
  EXPECT_NEAR(ask("bode --plant @m.json --json").json()["gain_crossover_rad_s"], 5.9995012056, 1e-9);
}

TEST_F(BadInput, ControllerFiles) {
  EXPECT_THAT(controller(R"({"kp":1,"kd":1})"), HasSubstr("\"mu\" is missing"));
  EXPECT_THAT(controller(R"({"kp":1,"kd":1,"mu":2.5})"), AllOf(HasSubstr("mu"), HasSubstr("2.5")));
  EXPECT_THAT(controller(R"({"kp":1,"kd":null,"mu":0.5})"), HasSubstr("key \"kd\" = null"));
  EXPECT_THAT(controller(R"({"kp":1,"kd":1,"mu":0.5,"ki":3})"), HasSubstr("\"ki\" = 3"));
}

TEST_F(BadInput, FilesThatAreNotThere) {
  EXPECT_THAT(complaint("bode --plant @no.json"), AllOf(HasSubstr("no.json"), HasSubstr("No such file")));
  EXPECT_THAT(complaint("bode --plant @."), HasSubstr("folder"));
  EXPECT_THAT(complaint("identify --csv @no.csv"), HasSubstr("no.csv"));
  EXPECT_THAT(complaint("identify --run 1 --data @nowhere"), HasSubstr("there is no"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "nowhere"));
}

TEST_F(BadInput, Exports) {
  const std::string run = "export --run 1 --data @nowhere --to @out ";
  EXPECT_THAT(complaint(run + "--format csv"), HasSubstr("there is no"));
  EXPECT_THAT(complaint(run + "--format csv --channels duty,volume"), HasSubstr("'volume' is no channel"));
  EXPECT_THAT(complaint(run + "--format sqlite --grid-us 10000"), HasSubstr("--grid-us is for csv and mat"));
  EXPECT_THAT(ask(run + "--format xls").error, HasSubstr("must be one of csv, mat, sqlite, mcap, is 'xls'"));
  EXPECT_THAT(ask(run + "--format csv --grid-us 1").error, HasSubstr("--grid-us must be"));
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(BadInput, CsvFiles) {
  EXPECT_THAT(csv(""), HasSubstr("no heading"));
  EXPECT_THAT(csv("t_s,position_m\n0,0\n"), HasSubstr("column duty is missing"));
  EXPECT_THAT(csv("t_s,duty\n0,0\n"), HasSubstr("position_m"));
  EXPECT_THAT(csv("duty,position_m\n0,0\n"), HasSubstr("t_s"));
  EXPECT_THAT(csv("t_s,duty,position_m\n0,0,0\n# remark\n0.1,x,0\n"), HasSubstr("line 4: 'x' in column duty"));
  EXPECT_THAT(csv("t_s,duty,position_m\n0,0\n"), HasSubstr("line 2"));
  EXPECT_THAT(csv("t_s,duty,position_m\n0,0,nan\n"), HasSubstr("'nan'"));
  EXPECT_THAT(csv("t_s,duty,position_m\n0,0,0\n0.1,0,\n"), HasSubstr("value 2 of column position_m is empty"));
  EXPECT_THAT(csv("t_s,duty,duty,position_m\n"), HasSubstr("twice"));
}

TEST_F(BadInput, CsvRowsLongerThanTheHeading) {
  EXPECT_THAT(csv("t_s,duty,position_m\n0,0,0\n0,1,0,3,0,05\n"),
              AllOf(HasSubstr("line 3: has 6 cells, the heading has 3"), HasSubstr("decimal comma? use ;")));
  const auto columns = analysis::parse_csv("note,t_s\n\"a,b\",1,\n", "text", {"t_s"});
  EXPECT_EQ(columns.at("t_s"), (std::vector<double>{1}));
}

TEST_F(BadInput, DutyInPercent) {
  EXPECT_THAT(csv("t_s,duty,position_m\n0,30,0\n"), HasSubstr("line 2: duty 30 is outside [-1, 1]; is it in percent?"));
  EXPECT_THAT(complaint("step --duty-csv @run.csv"), HasSubstr("in percent?"));
  save("motor.csv", "t_s,duty,rate_rad_s\n0,-1.5,0\n");
  EXPECT_THAT(complaint("model --motor-csv @motor.csv"), HasSubstr("duty -1.5"));
  EXPECT_EQ(ask("predict --duty-max 2").exit_code, 2);
}

TEST_F(BadInput, ValuesAreRefusedInOneSentence) {
  const auto said = [this](const std::string& command) {
    const Answer answer = ask(command);
    EXPECT_EQ(answer.exit_code, 2) << command;
    EXPECT_EQ(std::ranges::count(answer.error, '\n'), 1) << answer.error;
    EXPECT_THAT(answer.error, ::testing::StartsWith("rheonaut: ")) << command;
    return answer.error;
  };
  EXPECT_THAT(said("tune --crossover-rad-s 0 --phase-margin-deg 90"),
              HasSubstr("--crossover-rad-s must be a number from 0.001 to 10000, is 0"));
  // It took minutes to say that there is no such controller.
  EXPECT_THAT(said("tune --crossover-rad-s 1e9 --phase-margin-deg 90"), HasSubstr("from 0.001 to 10000, is 1e9"));
  EXPECT_THAT(said("tune --map --to-rad-s 1e9"), HasSubstr("--to-rad-s must be a number from 0.001 to 10000"));
  EXPECT_THAT(said("tune --crossover-rad-s 3 --phase-margin-deg 180"), HasSubstr("from 0.1 to 179.9, is 180"));
  EXPECT_THAT(said("tune --crossover-rad-s 3 --phase-margin-deg 90 --mu 2"), HasSubstr("from 0.01 to 1.99, is 2"));
  EXPECT_THAT(said("tune --crossover-rad-s nan --phase-margin-deg 90"), HasSubstr("is nan"));
  EXPECT_THAT(said("tune --crossover-rad-s 5 --phase-margin-deg inf"), HasSubstr("from 0.1 to 179.9, is inf"));
  EXPECT_THAT(said("bode --points 1e9"), HasSubstr("--points must be a whole number from 2 to 100000, is 1e9"));
  EXPECT_THAT(said("discretise --order 11"), HasSubstr("from 1 to 10, is 11"));
  EXPECT_THAT(said("discretise --method foo"), HasSubstr("--method must be one of direct, oustaloup, is 'foo'"));
  EXPECT_THAT(said("discretise --method 0"), HasSubstr("is '0'"));
  EXPECT_THAT(said("identify --csv x --structure 2"), HasSubstr("is '2'"));
  EXPECT_THAT(said("predict --seed 1.5"), HasSubstr("--seed must be a whole number"));
  EXPECT_THAT(said("predict --disturbance-at-s -1"), HasSubstr("must be 0 or more"));
  EXPECT_THAT(said("foo"), HasSubstr("'foo'"));
}

TEST_F(BadInput, EmptyNamesAreNotTheDefault) {
  for (const char* command : {"bode --plant", "bode --controller", "step --duty-csv", "model --motor-csv",
                              "identify --csv", "identify --run 1 --data", "check-config --data"}) {
    const Answer answer = ask(command + std::string{" @@"});
    EXPECT_EQ(answer.exit_code, 2) << command;
    EXPECT_THAT(answer.error, HasSubstr("must not be empty")) << command;
  }
}

TEST_F(BadInput, OptionsThatWouldGoUnused) {
  for (const char* command : {"model --preset newtonian --mass-kg 3", "model --preset newtonian --motor-csv m.csv",
                              "model --motor-csv m.csv --motor-gain-rad-s 3", "identify --plan --structure fractional",
                              "identify --csv run.csv --residuals"}) {
    const Answer answer = ask(command);
    EXPECT_EQ(answer.exit_code, 2) << command;
    EXPECT_NE(answer.error, "") << command;
  }
  EXPECT_THAT(complaint("bode --json --from-rad-s 2"), HasSubstr("--points"));
  EXPECT_EQ(ask("bode --json --from-rad-s 2").exit_code, 2);
  EXPECT_EQ(ask("bode --plant @no.json").exit_code, 1);
}

TEST_F(BadInput, CsvIsReadInAnyOrderWithSpacesQuotesAndOtherColumns) {
  const auto columns =
      analysis::parse_csv("\xEF\xBB\xBF# x\r\n\r\n \"duty\" , note,t_s\r\n +0.5, a,1e-1\r\n\"-1\",,0.2", "text",
                          {"t_s", "duty"}, {"position_m"});
  EXPECT_EQ(columns.at("duty"), (std::vector<double>{0.5, -1}));
  EXPECT_EQ(columns.at("t_s"), (std::vector<double>{0.1, 0.2}));
  EXPECT_EQ(columns.size(), 2u);
}

TEST_F(BadInput, FlagsOutOfRange) {
  EXPECT_EQ(ask("step --duty 1.5").exit_code, 2);
  EXPECT_EQ(ask("tune --crossover-rad-s 5").exit_code, 2);
  EXPECT_EQ(ask("bode --json --csv").exit_code, 2);
  EXPECT_THAT(ask("bode --nonsense").error, HasSubstr("nonsense"));
  EXPECT_THAT(complaint("bode --from-rad-s 10 --to-rad-s 1"), HasSubstr("10"));
  EXPECT_THAT(complaint("tune --crossover-rad-s 5 --phase-margin-deg 500"), HasSubstr("500"));
  EXPECT_THAT(complaint("step --every-s 1e-9"), HasSubstr("1e-09"));
  EXPECT_THAT(complaint("discretise --method oustaloup --a 0.5"), HasSubstr("a = 0.5 belongs to the method direct"));
}

TEST_F(BadInput, EveryCommandHelpsWithAnExample) {
  for (const char* name : {"model", "bode", "step", "identify", "estimator", "tune", "discretise", "predict"}) {
    const Answer answer = ask(std::string{name} + " --help");
    EXPECT_EQ(answer.exit_code, 0);
    EXPECT_THAT(answer.text, HasSubstr(std::string{"Example: rheonaut "} + name));
  }
}

}  // namespace
}  // namespace server::cli
