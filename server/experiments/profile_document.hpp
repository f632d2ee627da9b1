// The document of a profile: TOML or JSON with the same keys, in a file; or TOML with the program.
//
// docs/experiments.md lists its keys. Errors are std::invalid_argument, `name:line:column: key: what is wrong` (of JSON
// `name: key: what is wrong`), with the value and what is allowed. A profile that was read is within its own limits.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "base/embedded_file.hpp"
#include "base/fields.hpp"
#include "server/experiments/profile.hpp"

namespace server::experiments {

void fields(base::Fields& fields, Profile& profile);

// Every key, and every kind of step with its keys, as tables in Markdown for docs/experiments.md.
std::string profile_tables();

// JSON begins with {, as no TOML does. `name` stands for the text in errors.
Profile parse_profile(std::string_view text, const std::string& name);

inline constexpr std::size_t kMaxProfileFileBytes = 1 << 20;

// A file, or one of shipped_profiles() by its name.
Profile find_profile(const std::string& name_or_file);
std::span<const base::EmbeddedFile> shipped_profiles();

}  // namespace server::experiments
