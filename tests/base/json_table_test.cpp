// Objects of JSON as tables: every type, the places where it is refused.
#include "base/json_table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <stdexcept>

#include "base/toml_text.hpp"

namespace base {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string error_of(std::string_view text) {
  try {
    parse_json_table(text, "x.json");
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(JsonTable, HasTheTypesOfTheSameDocumentInToml) {
  const toml::table json = parse_json_table(
      R"({"a": -1, "b": 1.5, "c": true, "d": "text", "e": [1, 2.5, "x"], "f": {"g": [{"h": 9223372036854775807}]}})",
      "j");
  const toml::table toml =
      parse_toml("a = -1\nb = 1.5\nc = true\nd = 'text'\ne = [1, 2.5, 'x']\n[[f.g]]\nh = 9223372036854775807\n", "t");
  EXPECT_EQ(json, toml);
  EXPECT_TRUE(parse_json_table("{}", "j").empty());
}

TEST(JsonTable, RefusesWhatATableCannotHoldAndNamesIt) {
  EXPECT_EQ(error_of(R"({"a": {"b": null}})"), "x.json: b: must be a text, a number, true or false, is null");
  EXPECT_EQ(error_of(R"({"a": 9223372036854775808})"), "x.json: a: is 9223372036854775808, which is too large");
  EXPECT_EQ(error_of(R"({"a": {"b": 1}, "c": {"b": 2}, "a": 3})"), "x.json: a: is given twice");
  EXPECT_EQ(error_of("[1]"), "x.json: is JSON, but not an object");
  EXPECT_THAT(error_of("{\n\"a\": 1,\n}"), AllOf(StartsWith("x.json: is not JSON: "), HasSubstr("line 3, column 1")));
  EXPECT_THAT(error_of("{\"a\": " + std::string(100'000, '[')), HasSubstr("more than 16 deep"));
  EXPECT_THAT(error_of("{\"a\": \"" + std::string(1'000'000, 'x') + "\"}"), HasSubstr("allowed are 1000000"));
}

}  // namespace
}  // namespace base
