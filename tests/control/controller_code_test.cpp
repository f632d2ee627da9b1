// A controller written as C, compiled by the system's compiler, gives the duties of our own; the MATLAB text has the
// same arithmetic, which is evaluated here as C, since no MATLAB can be had and Octave is large. Where octave-cli is
// installed it runs the text itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <regex>
#include <sstream>

#include "control/discretisation/accuracy_doubt.hpp"
#include "control/discretisation/controller_code.hpp"

namespace control {
namespace {

using testing::HasSubstr;

const std::vector<double>& errors_m() {
  static const std::vector<double> all = [] {
    std::mt19937 random{4};
    std::normal_distribution<double> noise(0, 1e-3);
    std::vector<double> made;
    for (int k = 0; k < 400; ++k) made.push_back(0.1 * std::exp(-k / 80.0) + noise(random));
    return made;
  }();
  return all;
}

class ControllerCode : public testing::Test {
 protected:
  ControllerCode() {
    std::string name = (std::filesystem::temp_directory_path() / "rheonaut-code-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + name};
    folder_ = name;
    std::ofstream errors{folder_ / "errors.txt"};
    errors.precision(17);
    for (const double error_m : errors_m()) errors << error_m << '\n';
  }
  ~ControllerCode() override { std::filesystem::remove_all(folder_); }

  std::vector<double> duties(const std::string& command) {
    const std::string in_folder = "cd '" + folder_.string() + "' && " + command + " > duties.txt 2> errors.log";
    EXPECT_EQ(std::system(in_folder.c_str()), 0) << text_of("errors.log");
    std::ifstream file{folder_ / "duties.txt"};
    std::vector<double> read;
    for (double duty = 0; file >> duty;) read.push_back(duty);
    return read;
  }

  std::vector<double> run_as_c(const std::string& code) {
    std::ofstream{folder_ / "controller.c"} << code << R"(
#include <stdio.h>
int main(void) {
  double state[rheonaut_controller_states] = {0}, error_m;
  while (scanf("%lf", &error_m) == 1) printf("%.17g\n", rheonaut_controller_step(state, error_m));
  return 0;
}
)";
    return duties(std::string{C_COMPILER} +
                  " -std=c99 -Wall -Wextra -Werror -O1 controller.c -o controller && "
                  "./controller < errors.txt");
  }

  std::string text_of(const char* name) const {
    std::ifstream file{folder_ / name};
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }

  std::filesystem::path folder_;
};

std::vector<double> own_duties(const ParallelSections& sections) {
  SectionFilter filter(sections);
  std::vector<double> duties;
  for (const double error_m : errors_m()) duties.push_back(filter.step(error_m));
  return duties;
}

void expect_same(const std::vector<double>& duties, const std::vector<double>& expected) {
  ASSERT_EQ(duties.size(), expected.size());
  for (std::size_t k = 0; k < duties.size(); ++k) EXPECT_NEAR(duties[k], expected[k], 1e-12) << "step " << k;
}

// The statements between the head and `end`, with the states of C.
std::string matlab_as_c(const std::string& matlab) {
  std::string statements;
  std::istringstream lines{matlab};
  const std::regex state{R"(state\((\d+)\))"}, is_new{R"(^  (duty|pair_\d+) = (?!duty))"};
  for (std::string line; std::getline(lines, line);) {
    if (line.find(" * ") == std::string::npos && line.find("duty = duty") == std::string::npos) continue;
    if (line.front() == '%') continue;
    line = std::regex_replace(line, is_new, "  double $1 = ");
    statements += std::regex_replace(line, state, "state[$1 - 1]") + "\n";
  }
  return "enum { rheonaut_controller_states = 30 };\n"
         "double rheonaut_controller_step(double* state, double error_m) {\n" +
         statements + "  return duty;\n}\n";
}

Discretisation made_of(const FopdController& controller, DiscretisationMethod method) {
  DiscretisationOptions options;
  options.method = method;
  return discretise(controller, options);
}

Discretisation with_a_pair() {
  Discretisation made = made_of(kPaperController, DiscretisationMethod::direct);
  made.sections.second_order.push_back({3.5, -2.25, -1.2, 0.45});
  made.sections.second_order.push_back({-0.5, 0.125, 0.3, 0.2});
  return made;
}

TEST_F(ControllerCode, InCGivesTheDutiesOfOurOwn) {
  for (const auto method : {DiscretisationMethod::direct, DiscretisationMethod::oustaloup}) {
    const Discretisation made = made_of(kPaperController, method);
    expect_same(run_as_c(controller_code(CodeLanguage::c, kPaperController, made)), own_duties(made.sections));
  }
  const Discretisation pair = with_a_pair();
  expect_same(run_as_c(controller_code(CodeLanguage::c, kPaperController, pair)), own_duties(pair.sections));
}

TEST_F(ControllerCode, WithoutAStateIsCToo) {
  const FopdController proportional{65, 0, 0.5};
  const Discretisation made = made_of(proportional, DiscretisationMethod::direct);
  expect_same(run_as_c(controller_code(CodeLanguage::c, proportional, made)), own_duties(made.sections));
}

TEST_F(ControllerCode, InMatlabHasTheSameArithmetic) {
  const Discretisation pair = with_a_pair();
  const std::string code = controller_code(CodeLanguage::matlab, kPaperController, pair);
  EXPECT_THAT(code, testing::StartsWith("function [duty, state] = rheonaut_controller_step(state, error_m)\n"));
  EXPECT_THAT(code, HasSubstr("state = zeros(9, 1);"));
  expect_same(run_as_c(matlab_as_c(code)), own_duties(pair.sections));
}

TEST_F(ControllerCode, RunsInOctaveWhereThereIsOne) {
  if (std::system("command -v octave-cli > /dev/null 2>&1") != 0) GTEST_SKIP() << "octave-cli is not installed";
  const Discretisation pair = with_a_pair();
  std::ofstream{folder_ / "rheonaut_controller_step.m"}
      << controller_code(CodeLanguage::matlab, kPaperController, pair);
  std::ofstream{folder_ / "all.m"} << "state = []; e = load('errors.txt');\nfor k = 1:numel(e)\n"
                                      "  [duty, state] = rheonaut_controller_step(state, e(k));\n"
                                      "  printf('%.17g\\n', duty);\nend\n";
  expect_same(duties("octave-cli --no-init-file -q all.m"), own_duties(pair.sections));
}

TEST(AccuracyDoubt, IsASentenceWithTheNumbersWhereTheErrorIsNotAcceptable) {
  EXPECT_EQ(accuracy_doubt(made_of(kPaperController, DiscretisationMethod::direct)), "");
  DiscretisationOptions slow;
  slow.period_s = 0.1;
  const std::string doubt = accuracy_doubt(discretise(kPaperController, slow));
  EXPECT_THAT(doubt, HasSubstr("below 25.1 rad/s these coefficients are up to "));
  EXPECT_THAT(doubt, HasSubstr("shorten the period (--period-s)"));
}

}  // namespace
}  // namespace control
