// JSON as text: floats as short decimals, strings that need not be UTF-8, and what is wrong with a text.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace base {

// A float as the shortest decimal that gives the same float back: 0.1, not 0.10000000149011612. null unless finite.
nlohmann::json decimal(float value);

// The text of a JSON value; bytes that are not UTF-8 are replaced.
std::string dump(const nlohmann::json& value);

// "parse error at line 3, column 1: …": why it is no JSON.
std::string fault_of(const nlohmann::json::exception& error);

}  // namespace base
