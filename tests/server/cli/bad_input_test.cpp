// What the tools say to files and flags that they cannot use: one sentence with the place, the value and what is
// allowed.
#include <gmock/gmock.h>

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
    EXPECT_EQ(answer.exit_code, 1) << command;
    EXPECT_EQ(answer.text, "") << command;
    EXPECT_EQ(std::ranges::count(answer.error, '\n'), 0) << answer.error;
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
  EXPECT_THAT(plant(std::string(400'000, '[') + std::string(400'000, ']')), HasSubstr("an array is not a model"));
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

TEST_F(BadInput, CsvFiles) {
  EXPECT_THAT(csv(""), HasSubstr("no heading"));
  EXPECT_THAT(csv("t_s,position_m\n0,0\n"), HasSubstr("column duty is missing"));
  EXPECT_THAT(csv("t_s,duty\n0,0\n"), HasSubstr("position_m"));
  EXPECT_THAT(csv("duty,position_m\n0,0\n"), HasSubstr("t_s"));
  EXPECT_THAT(csv("t_s,duty,position_m\n0,0,0\n# remark\n0.1,x,0\n"), HasSubstr("line 4: 'x' in column duty"));
  EXPECT_THAT(csv("t_s,duty,position_m\n0,0\n"), HasSubstr("line 2"));
  EXPECT_THAT(csv("t_s,duty,position_m\n0,0,nan\n"), HasSubstr("'nan'"));
  EXPECT_THAT(csv("t_s,duty,duty,position_m\n"), HasSubstr("twice"));
}

TEST_F(BadInput, CsvIsReadInAnyOrderWithSpacesQuotesAndOtherColumns) {
  const auto columns = parse_csv("\xEF\xBB\xBF# x\r\n\r\n \"duty\" , note,t_s\r\n +0.5, a,1e-1\r\n\"-1\",,0.2", "text",
                                 {"t_s", "duty"}, {"position_m"});
  EXPECT_EQ(columns.at("duty"), (std::vector<double>{0.5, -1}));
  EXPECT_EQ(columns.at("t_s"), (std::vector<double>{0.1, 0.2}));
  EXPECT_EQ(columns.size(), 2u);
}

TEST_F(BadInput, FlagsOutOfRange) {
  EXPECT_GT(ask("step --duty 1.5").exit_code, 1);
  EXPECT_GT(ask("tune --crossover-rad-s 5").exit_code, 1);
  EXPECT_GT(ask("bode --json --csv").exit_code, 1);
  EXPECT_THAT(ask("bode --nonsense").error, HasSubstr("nonsense"));
  EXPECT_THAT(complaint("bode --from-rad-s 10 --to-rad-s 1"), HasSubstr("10"));
  EXPECT_THAT(complaint("tune --crossover-rad-s 5 --phase-margin-deg 500"), HasSubstr("500"));
  EXPECT_THAT(complaint("step --every-s 1e-9"), HasSubstr("1e-09"));
  EXPECT_THAT(complaint("discretise --method oustaloup --a 0.5"), HasSubstr("--a"));
}

TEST_F(BadInput, EveryCommandHelpsWithAnExample) {
  for (const char* name : {"model", "bode", "step", "identify", "tune", "discretise", "predict"}) {
    const Answer answer = ask(std::string{name} + " --help");
    EXPECT_EQ(answer.exit_code, 0);
    EXPECT_THAT(answer.text, HasSubstr(std::string{"Example: rheonaut "} + name));
  }
}

}  // namespace
}  // namespace server::cli
