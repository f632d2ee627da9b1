// A document in JSON as a TOML table, so that one FieldReader reads both.
#pragma once

#include <toml++/toml.h>

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace base {

// An object as a table. std::invalid_argument, `key: what is wrong`, for null and for a whole number beyond 64 bits.
toml::table table_of(const nlohmann::json& object);

// `name` stands for the text in errors, which are std::invalid_argument. Refused are texts of more than 1 MB, what is
// not one object, a key that is given twice, and objects and lists in each other more than 16 deep.
toml::table parse_json_table(std::string_view text, const std::string& name);

}  // namespace base
