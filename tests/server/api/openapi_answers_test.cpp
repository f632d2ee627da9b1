// The check of answers finds what is wrong with one, so that silence of it says something.
#include "tests/server/api/openapi_answers.hpp"

#include <gmock/gmock.h>

namespace server {
namespace {

using nlohmann::json;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(OpenapiAnswers, AFaultOfAValueIsFound) {
  const json schema = json::parse(R"({"type":"object","required":["id"],"properties":{
      "id":{"type":"string","pattern":"^[1-9][0-9]{0,19}$"},"count":{"type":["integer","null"],"minimum":1},
      "state":{"enum":["open","ended"]},"list":{"type":"array","maxItems":2,"items":{"type":"number"}}}})");
  EXPECT_THAT(schema_faults(schema, {{"id", "12"}, {"count", 2.0}, {"state", "open"}, {"list", {1, 2.5}}}), IsEmpty());
  const std::pair<json, const char*> wrong[] = {
      {{{"count", 1}}, "has no id"},
      {{{"id", "012"}}, "does not match"},
      {{{"id", 12}}, "is not of type"},
      {{{"id", "1"}, {"count", 1.5}}, "is not of type"},
      {{{"id", "1"}, {"count", 0}}, "below its minimum"},
      {{{"id", "1"}, {"state", "shut"}}, "none of the enumerators"},
      {{{"id", "1"}, {"list", {1, 2, 3}}}, "too many items"},
      {{{"id", "1"}, {"list", {nullptr}}}, "is not of type"},
      {{{"id", "1"}, {"more", 1}}, "the member more, which is not described"},
  };
  for (const auto& [value, what] : wrong) EXPECT_THAT(schema_faults(schema, value), ElementsAre(HasSubstr(what)));
}

TEST(OpenapiAnswers, AFaultOfAnAnswerIsFound) {
  const auto problem = [](int status, json more) {
    json body{
        {"type", "about:blank"}, {"title", "t"}, {"status", status}, {"detail", "d"}, {"reason", "not_permitted"}};
    body.update(more);
    return answer_faults("GET", "/api/v1/runs/{run_id}", status, "application/problem+json", body.dump());
  };
  EXPECT_THAT(problem(403, {{"needs", "operator"}}), IsEmpty());
  EXPECT_THAT(problem(403, {{"needs", nullptr}}), IsEmpty());
  EXPECT_THAT(problem(403, json::object()), ElementsAre(HasSubstr("has no needs")));
  EXPECT_THAT(problem(404, {{"reason", "of_no_list"}}), Contains(HasSubstr("reason")));
  EXPECT_THAT(problem(404, {{"reason", "unknown_17"}}), IsEmpty());
  EXPECT_THAT(problem(404, {{"reason", ""}}), Contains(HasSubstr("reason")));
  EXPECT_THAT(answer_faults("GET", "/api/v1/runs", 200, "application/json", R"({"runs":[]})"),
              ElementsAre(HasSubstr("has no next")));
  EXPECT_THAT(answer_faults("GET", "/api/v1/runs", 201, "application/json", "{}"),
              ElementsAre(HasSubstr("status 201 is not described")));
  EXPECT_THAT(answer_faults("GET", "/api/v1/runs", 200, "text/plain", "x"), ElementsAre(HasSubstr("text/plain")));
}

}  // namespace
}  // namespace server
