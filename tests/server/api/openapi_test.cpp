// The document and the routes say the same, both ways.
#include <gmock/gmock.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <set>

#include "server/http/router.hpp"
#include "tests/server/api/api_fixture.hpp"
#include "tests/server/api/openapi_document.hpp"

namespace server {
namespace {

struct Operation {
  std::map<std::string, json> query;  // its parameters
  std::string scope;
  bool has_body = false;
};
using Operations = std::map<std::string, Operation>;  // by "GET /path"

const json& resolved(const json& document, const json& part) {
  return part.contains("$ref") ? document.at(json::json_pointer{part["$ref"].get<std::string>().substr(1)}) : part;
}

Operations documented() {
  const json document = openapi_document();
  Operations operations;
  for (const auto& [path, methods] : document["paths"].items()) {
    for (const auto& [method, described] : methods.items()) {
      if (method == "parameters") continue;
      std::string name = method;
      std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
      Operation& operation = operations[name + " " + path];
      operation.scope = described["x-scope"];
      operation.has_body = described.contains("requestBody");
      for (const json& given : described.value("parameters", json::array())) {
        json parameter = resolved(document, given);
        if (parameter["in"] != "query") continue;
        parameter["schema"] = resolved(document, parameter["schema"]);
        operation.query.emplace(parameter["name"], std::move(parameter));
      }
    }
  }
  return operations;
}

// Values that the schema of a query parameter allows, and others.
struct Values {
  std::vector<std::string> right, wrong;
};
Values values_of(const json& schema) {
  if (schema.contains("pattern")) return {{}, {"%C3%A9!", "a%20b"}};
  Values values{{}, {"x", "", "1e3", "99999999999999999999"}};
  if (schema["type"] == "boolean") values.right = {"true", "false"};
  if (schema.contains("enum")) values.right = schema["enum"];
  std::ranges::replace(values.right, std::string{"event"}, std::string{"event&event=detection"});  // needs its kind
  if (schema["type"] != "integer") return values.right.empty() ? Values{} : values;
  if (schema.contains("minimum")) {
    values.right.push_back(schema["minimum"].dump());
    values.wrong.push_back(std::to_string(schema["minimum"].get<std::int64_t>() - 1));
  }
  if (schema.contains("maximum")) {
    values.right.push_back(schema["maximum"].dump());
    values.wrong.push_back(std::to_string(schema["maximum"].get<std::int64_t>() + 1));
  }
  return values;
}

// "/api/v1/runs/{run_id}/samples" as of something that may be there.
std::string path_of(std::string pattern) {
  for (auto begin = pattern.find('{'); begin != std::string::npos; begin = pattern.find('{')) {
    const auto end = pattern.find('}') + 1;
    pattern.replace(begin, end - begin, pattern.substr(begin, end - begin) == "{robot_id}" ? "r1" : "1");
  }
  return pattern;
}

class OpenapiTest : public ApiTest {};

TEST_F(OpenapiTest, EveryRouteIsDocumentedAndEveryDocumentedRouteExists) {
  const Operations document = documented();
  std::set<std::string> described, registered;
  for (const auto& [operation, details] : document) described.insert(operation);
  for (const http::Route& route : router().routes()) registered.insert(route.method + " " + route.pattern);
  EXPECT_EQ(described, registered);
  EXPECT_GE(described.size(), 18U);
}

TEST_F(OpenapiTest, QueryParametersAreTheSame) {
  const Operations document = documented();
  for (const http::Route& route : router().routes()) {
    const std::string operation = route.method + " " + route.pattern;
    const std::set<std::string> known{route.query.begin(), route.query.end()};
    std::set<std::string> described;
    for (const auto& [name, parameter] : document.at(operation).query) described.insert(name);
    EXPECT_EQ(described, known) << operation;
  }
  EXPECT_FALSE(router().routes().empty());
}

TEST_F(OpenapiTest, QueryParametersAreRefusedWhereTheDocumentForbidsThemAndOnlyThere) {
  connect_robot();
  int asked = 0;
  for (const auto& [operation, described] : documented()) {
    const std::string method = operation.substr(0, operation.find(' '));
    const std::string path = path_of(operation.substr(operation.find(' ') + 1));
    if (!path.starts_with("/api/") || described.has_body) continue;
    for (const auto& [name, parameter] : described.query) {
      std::string target = path + "?";
      for (const auto& [other, required] : described.query) {
        if (other != name && required.value("required", false))
          target += other + "=" + required["example"].get<std::string>() + "&";
      }
      target += name + "=";
      const Values values = values_of(parameter["schema"]);
      for (const std::string& value : values.right)
        EXPECT_NE(ask(method, target + value).status, 400) << target + value;
      for (const std::string& value : values.wrong) {
        EXPECT_THAT(ask(method, target + value).status, ::testing::AnyOf(400, 422)) << target + value;
      }
      asked += static_cast<int>(values.right.size() + values.wrong.size());
    }
  }
  EXPECT_GE(asked, 300);
}

TEST_F(OpenapiTest, ABodyThatIsNoJsonIs400WhateverItIsFor) {
  connect_robot();
  const json malformed = json::parse("{", nullptr, false);
  for (const auto& [operation, described] : documented()) {
    if (!described.has_body || operation == "POST /api/v1/foxglove-links") continue;  // that is off
    EXPECT_EQ(ask("POST", path_of(operation.substr(5)), malformed).status, 400) << operation;
  }
}

TEST_F(OpenapiTest, EveryRouteNeedsWhatTheDocumentSays) {
  const Operations document = documented();
  for (const http::Route& route : router().routes()) {
    const std::string operation = route.method + " " + route.pattern;
    EXPECT_EQ(document.at(operation).scope, text(route.needs)) << operation;
  }
  EXPECT_FALSE(router().routes().empty());
}

// Every example of docs/api.md calls a route that exists, and its JSON is JSON.
TEST_F(OpenapiTest, TheExamplesOfTheDocumentCallExistingRoutes) {
  std::ifstream in{API_MD};
  std::set<std::string> called;
  std::string line, block;
  bool in_json = false;
  int json_blocks = 0;
  while (std::getline(in, line)) {
    if (line == "```json") {
      in_json = true;
      block.clear();
    } else if (line == "```" && in_json) {
      in_json = false;
      ++json_blocks;
      EXPECT_TRUE(json::accept(block)) << block;
    } else if (in_json) {
      block += line;
    }
    const auto target = line.find("$STATION/");
    if (!line.starts_with("ask ") || target == std::string::npos) continue;
    const auto begin = target + std::string_view{"$STATION"}.size();
    const std::string method = line.find("-X POST") == std::string::npos ? "GET" : "POST";
    const int status = ask(method, line.substr(begin, line.find_first_of("' \"", begin) - begin)).status;
    EXPECT_NE(status, 405) << line;
    called.insert(line);
  }
  EXPECT_GE(called.size(), 15U);
  EXPECT_GE(json_blocks, 5);
}

TEST_F(OpenapiTest, IsServedAsItStandsInTheRepository) {
  std::ifstream in{OPENAPI_YAML};
  const std::string file{std::istreambuf_iterator<char>{in}, {}};
  const Answered answered = ask("GET", "/api/v1/openapi.yaml");
  EXPECT_EQ(answered.status, 200);
  EXPECT_EQ(answered.body, file);
}

}  // namespace
}  // namespace server
