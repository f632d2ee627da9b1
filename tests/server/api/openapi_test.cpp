// The document and the routes say the same, both ways.
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
  std::set<std::string> query;
  std::string scope;
};
using Operations = std::map<std::string, Operation>;  // by "GET /path"

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
      for (json parameter : described.value("parameters", json::array())) {
        if (parameter.contains("$ref"))
          parameter = document.at(json::json_pointer{parameter["$ref"].get<std::string>().substr(1)});
        if (parameter["in"] == "query") operation.query.insert(parameter["name"]);
      }
    }
  }
  return operations;
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
    EXPECT_EQ(document.at(operation).query, known) << operation;
  }
  EXPECT_FALSE(router().routes().empty());
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
