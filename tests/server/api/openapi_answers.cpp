#include "tests/server/api/openapi_answers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <regex>
#include <set>

#include "tests/server/api/api_fixture.hpp"
#include "tests/server/api/openapi_document.hpp"

namespace server {
namespace {

constexpr std::size_t kMostItems = 100;  // checked at each end of a long list

const json& document() {
  static const json kDocument = openapi_document();
  return kDocument;
}

const json& resolved(const json& schema) {
  if (!schema.contains("$ref")) return schema;
  return resolved(document().at(json::json_pointer{schema["$ref"].get<std::string>().substr(1)}));
}

// The member, or null. Not a copy: a schema may be most of the document.
const json& member_of(const json& schema, const char* key) {
  static const json kNull;
  const auto found = schema.find(key);
  return found == schema.end() ? kNull : *found;
}

bool is_integer(const json& value) {
  return value.is_number_integer() ||
         (value.is_number_float() && std::trunc(value.get<double>()) == value.get<double>());
}

bool has_type(const json& value, const std::string& type) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "null") return value.is_null();
  if (type == "integer") return is_integer(value);
  return type == "number" && value.is_number();
}

bool matches(const std::string& text, const std::string& pattern) {
  static std::map<std::string, std::regex> known;
  const auto found = known.try_emplace(pattern, pattern).first;
  return std::regex_search(text, found->second);
}

// The members that an object may have; none: any.
std::optional<std::set<std::string>> known_members(const json& given) {
  const json& schema = resolved(given);
  const json& additional = member_of(schema, "additionalProperties");
  if (additional.is_object() || additional == true) return std::nullopt;
  std::set<std::string> names;
  const json& properties = member_of(schema, "properties");
  for (const auto& [name, property] : properties.items()) names.insert(name);
  bool is_open = properties.empty() && additional.is_null();
  for (const char* key : {"allOf", "oneOf", "anyOf"}) {
    for (const json& part : member_of(schema, key)) {
      is_open = false;
      const auto more = known_members(part);
      if (!more) return std::nullopt;
      names.insert(more->begin(), more->end());
    }
  }
  if (is_open) return std::nullopt;
  return names;
}

class Check {
 public:
  std::vector<std::string> faults;

  void value(const json& given, const json& value, const std::string& at, bool is_part = false) {
    const json& schema = resolved(given);
    check_type(schema, value, at);
    if (schema.contains("const") && value != schema["const"]) fault(at, value, "is not " + schema["const"].dump());
    if (schema.contains("enum") && std::ranges::find(schema["enum"], value) == schema["enum"].end())
      fault(at, value, "is none of the enumerators");
    if (value.is_string()) check_text(schema, value, at);
    if (value.is_number()) check_number(schema, value, at);
    if (value.is_array()) check_items(schema, value, at);
    if (value.is_object()) check_members(schema, value, at);
    if (value.is_object() && !is_part) check_known(schema, value, at);
    for (const json& part : member_of(schema, "allOf")) this->value(part, value, at, true);
    for (const char* key : {"oneOf", "anyOf"}) check_choice(schema, key, value, at);
  }

 private:
  void fault(const std::string& at, const json& value, const std::string& what) {
    faults.push_back(fmt::format("{} = {} {}", at.empty() ? "it" : at, value.dump().substr(0, 200), what));
  }

  void check_type(const json& schema, const json& value, const std::string& at) {
    if (!schema.contains("type")) return;
    const json& type = schema["type"];
    const auto fits = [&value](const json& one) { return has_type(value, one.get<std::string>()); };
    const bool is_right = type.is_array() ? std::ranges::any_of(type, fits) : fits(type);
    if (!is_right) fault(at, value, "is not of type " + type.dump());
  }

  void check_text(const json& schema, const json& value, const std::string& at) {
    const auto text = value.get<std::string>();
    if (schema.contains("pattern") && !matches(text, schema["pattern"])) {
      fault(at, value, "does not match " + schema["pattern"].dump());
    }
    if (text.size() < schema.value("minLength", std::size_t{0})) fault(at, value, "is too short");
    if (text.size() > schema.value("maxLength", text.size())) fault(at, value, "is too long");
  }

  void check_number(const json& schema, const json& value, const std::string& at) {
    const auto number = value.get<double>();
    if (number < schema.value("minimum", number)) fault(at, value, "is below its minimum");
    if (number > schema.value("maximum", number)) fault(at, value, "is above its maximum");
    if (schema.contains("exclusiveMinimum") && number <= schema["exclusiveMinimum"].get<double>())
      fault(at, value, "is not above its minimum");
  }

  void check_items(const json& schema, const json& value, const std::string& at) {
    if (value.size() < schema.value("minItems", std::size_t{0})) fault(at, value, "has too few items");
    if (value.size() > schema.value("maxItems", value.size())) fault(at, value, "has too many items");
    if (!schema.contains("items")) return;
    for (std::size_t i = 0; i < value.size(); ++i) {
      if (i >= kMostItems && i + kMostItems < value.size()) continue;
      this->value(schema["items"], value[i], fmt::format("{}[{}]", at, i));
    }
  }

  void check_members(const json& schema, const json& value, const std::string& at) {
    for (const json& name : member_of(schema, "required")) {
      if (!value.contains(name)) fault(at, value, "has no " + name.get<std::string>());
    }
    const json& properties = member_of(schema, "properties");
    const json& additional = member_of(schema, "additionalProperties");
    for (const auto& [name, member] : value.items()) {
      const std::string inner = at.empty() ? name : at + "." + name;
      if (properties.contains(name)) {
        this->value(properties[name], member, inner);
      } else if (additional.is_object()) {
        this->value(additional, member, inner);
      }
    }
  }

  void check_known(const json& schema, const json& value, const std::string& at) {
    const auto known = known_members(schema);
    if (!known) return;
    for (const auto& [name, member] : value.items()) {
      if (!known->contains(name)) fault(at, value, "has the member " + name + ", which is not described");
    }
  }

  void check_choice(const json& schema, const char* key, const json& value, const std::string& at) {
    if (!schema.contains(key)) return;
    std::vector<std::string> first;
    std::size_t fitting = 0;
    for (const json& choice : schema[key]) {
      Check inner;
      inner.value(choice, value, at);
      fitting += inner.faults.empty() ? 1 : 0;
      if (first.empty()) first = std::move(inner.faults);
    }
    const bool is_one = key == std::string{"anyOf"} ? fitting > 0 : fitting == 1;
    if (is_one) return;
    fault(at, value, fmt::format("fits {} of the schemas of {}", fitting, key));
    if (fitting == 0) faults.insert(faults.end(), first.begin(), first.end());
  }
};

}  // namespace

std::vector<std::string> schema_faults(const json& schema, const json& value) {
  Check check;
  check.value(schema, value, "");
  return std::move(check.faults);
}

std::vector<std::string> answer_faults(const std::string& method, const std::string& pattern, int status,
                                       const std::string& content_type, const std::string& body) {
  std::string name = method == "HEAD" ? "get" : method;
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const json& responses = document().at("paths").at(pattern).at(name).at("responses");
  const std::string code = std::to_string(status);
  const bool is_problem = content_type == "application/problem+json";
  if (!responses.contains(code) && !(responses.contains("default") && is_problem)) {
    return {fmt::format("{} {}: the status {} is not described", method, pattern, status)};
  }
  const json& response = resolved(responses.at(responses.contains(code) ? code : "default"));
  const json& content = member_of(response, "content");
  const std::string type = content_type.substr(0, content_type.find(';'));
  if (!content.contains(type)) {
    if (body.empty()) return {};
    return {fmt::format("{} {}: content of type '{}' is not described", method, pattern, content_type)};
  }
  const json& schema = member_of(content.at(type), "schema");
  if (method == "HEAD" || !type.ends_with("json") || !schema.is_object()) return {};
  const json value = json::parse(body);
  std::vector<std::string> faults = schema_faults(schema, value);
  if (status == 403 && !value.contains("needs")) faults.push_back("it has no needs");
  for (std::string& fault : faults) fault = fmt::format("{} {} {}: {}", method, pattern, status, fault);
  return faults;
}

namespace {

void hold_to_the_document(const Answered& answered) {
  for (const std::string& fault : answer_faults(answered.method, answered.pattern, answered.status,
                                                answered.response.content_type, answered.body)) {
    ADD_FAILURE() << fault;
  }
}

[[maybe_unused]] const bool kAreHeld = [] {
  check_answer = hold_to_the_document;
  return true;
}();

}  // namespace

}  // namespace server
