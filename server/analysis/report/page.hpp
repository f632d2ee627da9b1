// What the reports have in common: the head of the page with its style, and texts of values.
//
// A page loads nothing and has no script. It is light or dark as its reader's screen is, and prints light. Colours are
// variables of CSS: --measured, --commanded, --outside, and --run-1 to --run-12. Pure.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace server::analysis {

inline constexpr int kRunColours = 12;

std::string page_head(const std::string& title);  // up to and with <body>
std::string page_end();

std::string utc_text(std::int64_t at_us);
std::string number_text(const nlohmann::json& value, int digits = 4);
std::string number_text(double value, int digits = 4);

// Rows of a name and a value; those without a value are left out.
std::string pairs_of(const std::vector<std::pair<std::string, std::string>>& rows);

std::string made_by(std::int64_t made_at_us, const std::string& program);

}  // namespace server::analysis
