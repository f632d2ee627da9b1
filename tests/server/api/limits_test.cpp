// The limits that the parsers of request bodies take are those of the document, and the document has no others.
#include "server/api/bodies/limits.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "tests/server/api/openapi_document.hpp"

namespace server {
namespace {

using nlohmann::json;

// What one property of the document allows; for a text and a list its length.
struct Documented {
  std::string type;
  json minimum, maximum;
  bool operator==(const Documented&) const = default;
};
using Properties = std::map<std::string, Documented>;

// Walks what a client may send: the schemas of request bodies, and those that they refer to.
class RequestSchemas {
 public:
  explicit RequestSchemas(const json& document) : schemas_{document["components"]["schemas"]} {
    for (const auto& [path, operations] : document["paths"].items()) {
      for (const auto& [method, operation] : operations.items()) {
        if (method == "parameters" || !operation.contains("requestBody")) continue;
        ++bodies;
        for (const auto& [media, content] : operation["requestBody"]["content"].items()) walk("", content["schema"]);
      }
    }
  }

  Properties limits;
  std::set<std::string> unlimited_texts, unlimited_integers;
  int bodies = 0;

 private:
  void walk(const std::string& name, const json& schema) {
    if (schema.contains("$ref")) {
      const std::string ref = schema["$ref"];
      const std::string of = ref.substr(ref.rfind('/') + 1);
      if (seen_.insert(of).second) walk(of, schemas_.at(of));
      return;
    }
    for (const json& one : schema.value("oneOf", json::array())) walk(name, one);
    for (const auto& [member, property] : schema.value("properties", json::object()).items()) {
      walk(name + "." + member, property);
    }
    if (schema.contains("items")) walk(name + "[]", schema["items"]);
    note(name, schema);
  }

  void note(const std::string& name, const json& schema) {
    static const std::map<std::string, std::pair<const char*, const char*>> kKeys = {
        {"string", {"minLength", "maxLength"}},
        {"integer", {"minimum", "maximum"}},
        {"number", {"minimum", "maximum"}},
        {"array", {"minItems", "maxItems"}}};
    const json type = schema.contains("type") ? schema["type"] : json("");
    const std::string kind = type.is_array() ? type[0] : type;
    if (!kKeys.contains(kind)) return;
    const auto& [least, most] = kKeys.at(kind);
    Documented found{kind, schema.value(least, json()), schema.value(most, json())};
    if (schema.contains("exclusiveMinimum")) found.minimum = schema["exclusiveMinimum"];
    if ((kind == "string" || kind == "array") && found.minimum.is_null() && !found.maximum.is_null()) found.minimum = 0;
    if (!found.minimum.is_null() || !found.maximum.is_null()) {
      const auto [at, is_new] = limits.emplace(name, found);
      EXPECT_EQ(at->second, found) << name << " has two limits";
    } else if (kind == "string" && !schema.contains("enum") && !schema.contains("const") &&
               !schema.contains("pattern")) {
      unlimited_texts.insert(name);
    } else if (kind == "integer") {
      unlimited_integers.insert(name);
    }
  }

  const json& schemas_;
  std::set<std::string> seen_;
};

// A float32 has not all digits of what the document says.
template <class Number>
json as_documented(Number number) {
  if constexpr (std::is_floating_point_v<Number>) return static_cast<float>(number);
  return number;
}

template <class Number, std::size_t size>
void expect_documented(const api::Limit<Number> (&table)[size], const char* type, Properties& left) {
  for (const api::Limit<Number>& limit : table) {
    const std::string name{limit.property};
    const auto found = left.find(name);
    if (found == left.end()) {
      ADD_FAILURE() << name << " is not in the document, or twice in the table";
      continue;
    }
    EXPECT_EQ(found->second.type, type) << name;
    EXPECT_EQ(as_documented(found->second.minimum.template get<Number>()), as_documented(limit.range.minimum)) << name;
    EXPECT_EQ(as_documented(found->second.maximum.template get<Number>()), as_documented(limit.range.maximum)) << name;
    left.erase(found);
  }
}

TEST(Limits, AreThoseOfTheDocumentInBothDirections) {
  const json document = openapi_document();
  RequestSchemas requests{document};
  EXPECT_EQ(requests.bodies, 29);
  Properties left = requests.limits;
  expect_documented(api::kTextLimits, "string", left);
  expect_documented(api::kIntegerLimits, "integer", left);
  expect_documented(api::kNumberLimits, "number", left);
  expect_documented(api::kLimitsOfTheRobot, "number", left);
  expect_documented(api::kListLimits, "array", left);
  for (const auto& [name, limit] : left) ADD_FAILURE() << name << " is limited in the document alone";
}

TEST(Limits, EveryTextAndIntegerOfARequestHasOne) {
  const json document = openapi_document();
  const RequestSchemas requests{document};
  EXPECT_EQ(requests.unlimited_texts, std::set<std::string>{});
  EXPECT_EQ(requests.unlimited_integers, std::set<std::string>{});
}

std::string marker(const std::string& text) { return json{{"text", text}}.dump(); }
std::string repeated(std::size_t count, const std::string& character) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += character;
  return text;
}

// The document says so, since its maxLength counts characters.
TEST(Limits, OfTextsCountBytesAndNotCharacters) {
  constexpr std::size_t kMost = api::text_bytes("MarkerBody.text").maximum;
  EXPECT_TRUE(api::parse_marker(marker(repeated(kMost, "a"))));
  EXPECT_TRUE(api::parse_marker(marker(repeated(kMost / 2, "ä"))));
  for (const std::string& text : {repeated(kMost + 1, "a"), repeated(kMost / 2 + 1, "ä"), std::string{}}) {
    const auto refused = api::parse_marker(marker(text));
    ASSERT_FALSE(refused) << text.size();
    EXPECT_EQ(refused.error().reason, "out_of_range");
  }
  const std::string said = openapi_document()["info"]["description"];
  EXPECT_NE(said.find("counts bytes of UTF-8"), std::string::npos);
}

}  // namespace
}  // namespace server
