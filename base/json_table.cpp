#include "base/json_table.hpp"

#include <set>
#include <vector>

#include "base/invalid_argument.hpp"
#include "base/json_text.hpp"
#include "base/toml_text.hpp"

namespace base {
namespace {

using Json = nlohmann::json;

constexpr int kMostDepth = 16;

toml::array array_of(const Json& list, const std::string& key);

// Calls insert(value) with the value as its TOML type.
template <class Insert>
void convert(const Json& value, const std::string& key, const Insert& insert) {
  switch (value.type()) {
    case Json::value_t::object: return insert(table_of(value));
    case Json::value_t::array: return insert(array_of(value, key));
    case Json::value_t::string: return insert(value.get<std::string>());
    case Json::value_t::boolean: return insert(value.get<bool>());
    case Json::value_t::number_integer: return insert(value.get<std::int64_t>());
    case Json::value_t::number_float: return insert(value.get<double>());
    case Json::value_t::number_unsigned:
      if (value.get<std::uint64_t>() > INT64_MAX) throw_invalid(key, ": is ", value.dump(), ", which is too large");
      return insert(value.get<std::int64_t>());
    default: throw_invalid(key, ": must be a text, a number, true or false, is null");
  }
}

toml::array array_of(const Json& list, const std::string& key) {
  toml::array array;
  for (const Json& element : list) {
    convert(element, key, [&array](auto&& value) { array.push_back(std::forward<decltype(value)>(value)); });
  }
  return array;
}

// Throws at the first key that an object has twice, and where the text is too deep.
class Watch {
 public:
  bool operator()(int depth, Json::parse_event_t event, const Json& parsed) {
    if (event == Json::parse_event_t::object_start) {
      keys_.emplace_back();
    } else if (event == Json::parse_event_t::object_end) {
      keys_.pop_back();
    } else if (event == Json::parse_event_t::key) {
      const auto key = parsed.get<std::string>();
      if (!keys_.back().insert(key).second) throw_invalid(key, ": is given twice");
    }
    if (depth > kMostDepth) throw_invalid("has objects and lists in each other, more than ", kMostDepth, " deep");
    return true;
  }

 private:
  std::vector<std::set<std::string>> keys_;  // of the objects that are open
};

}  // namespace

toml::table table_of(const Json& object) {
  toml::table table;
  for (const auto& [key, value] : object.items()) {
    convert(value, key, [&table, &key](auto&& made) { table.insert(key, std::forward<decltype(made)>(made)); });
  }
  return table;
}

toml::table parse_json_table(std::string_view text, const std::string& name) try {
  if (text.size() > kMaxDocumentBytes) {
    throw_invalid("has ", text.size(), " bytes, allowed are ", kMaxDocumentBytes);
  }
  Watch watch;
  const Json parsed = Json::parse(
      text, [&watch](int depth, Json::parse_event_t event, const Json& value) { return watch(depth, event, value); });
  if (!parsed.is_object()) throw_invalid("is JSON, but not an object");
  return table_of(parsed);
} catch (const Json::exception& error) {
  throw_invalid(name, ": is not JSON: ", fault_of(error));
} catch (const std::invalid_argument& error) {
  throw_invalid(name, ": ", error.what());
}

}  // namespace base
