// The document and the routes say the same, both ways.
#include <fstream>
#include <set>

#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

struct Operation {
  std::set<std::string> query;
  std::string scope;
};
using Operations = std::map<std::string, Operation>;  // by "GET /path"

std::size_t indentation(const std::string& line) { return line.find_first_not_of(' '); }

// Reads the part below `paths:`, which is written with two spaces a level and parameters one a line.
Operations documented() {
  std::ifstream in{OPENAPI_YAML};
  Operations operations;
  std::string line, path, operation;
  bool in_paths = false;
  while (std::getline(in, line)) {
    if (line.empty()) continue;
    const auto depth = indentation(line);
    if (depth == 0) in_paths = line == "paths:";
    if (!in_paths) continue;
    const std::string key = line.substr(depth, line.find(':') - depth);
    if (depth == 2) path = key;
    const bool is_method = depth == 4 && (key == "get" || key == "post" || key == "put" || key == "delete");
    if (is_method) {
      operation = (key == "get" ? "GET " : key == "post" ? "POST " : key + " ") + path;
      operations[operation];
    }
    if (depth == 6 && key == "x-scope") operations[operation].scope = line.substr(line.find(':') + 2);
    if (depth < 8) continue;
    if (line.find("parameters/limit'") != std::string::npos) operations[operation].query.insert("limit");
    const auto name = line.find("{ name: ");
    if (name != std::string::npos && line.find("in: query") != std::string::npos) {
      operations[operation].query.insert(line.substr(name + 8, line.find(',', name) - name - 8));
    }
  }
  return operations;
}

class OpenapiTest : public ApiTest {};

TEST_F(OpenapiTest, EveryRouteIsDocumentedAndEveryDocumentedRouteExists) {
  const Operations document = documented();
  std::set<std::string> described, registered;
  for (const auto& [operation, details] : document) described.insert(operation);
  for (const Route& route : api->router().routes()) registered.insert(route.method + " " + route.pattern);
  EXPECT_EQ(described, registered);
  EXPECT_GE(described.size(), 18U);
}

TEST_F(OpenapiTest, QueryParametersAreTheSame) {
  const Operations document = documented();
  for (const Route& route : api->router().routes()) {
    const std::string operation = route.method + " " + route.pattern;
    const std::set<std::string> known{route.query.begin(), route.query.end()};
    EXPECT_EQ(document.at(operation).query, known) << operation;
  }
}

TEST_F(OpenapiTest, EveryRouteNeedsWhatTheDocumentSays) {
  const Operations document = documented();
  for (const Route& route : api->router().routes()) {
    const std::string operation = route.method + " " + route.pattern;
    EXPECT_EQ(document.at(operation).scope, text(route.needs)) << operation;
  }
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
