// A text in TOML as a table, of bounded size and depth.
#pragma once

#include <toml++/toml.h>

#include <string>
#include <string_view>

#include "base/invalid_argument.hpp"
#include "base/nesting.hpp"

namespace base {

inline constexpr std::size_t kMaxDocumentBytes = 1'000'000;

// `name` stands for the text in errors, which are std::invalid_argument: `name:line:column: what is wrong`.
inline toml::table parse_toml(std::string_view text, const std::string& name) {
  if (text.size() > kMaxDocumentBytes) {
    throw_invalid(name, ": has ", text.size(), " bytes, allowed are ", kMaxDocumentBytes);
  }
  if (is_toml_deeper(text, kMostTomlDepth)) {
    throw_invalid(name, ": has tables, keys and lists in each other, more than ", kMostTomlDepth, " deep");
  }
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    const toml::source_position at = error.source().begin;
    throw_invalid(name, ":", at.line, ":", at.column, ": ", error.description());
  }
}

}  // namespace base
