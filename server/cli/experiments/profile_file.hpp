// What a person names as a profile, as a station takes it.
#pragma once

#include <string>

namespace server::cli {

// The text of a file in TOML or JSON; the name of a profile that comes with the program stays a name. Throws
// std::runtime_error for a file that cannot be read.
std::string profile_document(const std::string& name_or_file);

}  // namespace server::cli
