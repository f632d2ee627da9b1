// The tables of the recording, as numbered migrations; docs/database.md explains them to people.
//
// Migration n, in migrations/n.sql, brings a database from user_version n - 1 to n. A released migration is never
// changed, since databases keep its text: a new file is added, and named in CMakeLists.txt.
#pragma once

#include <cstdint>
#include <span>

#include "base/embedded_file.hpp"

namespace server::storage {

constexpr std::int32_t kApplicationId = 0x5268656f;  // "Rheo"
constexpr std::int64_t kMaxSegmentSamples = 100;     // the views and queries look this far back for a segment's begin
constexpr std::uint64_t kBootsApart = 37;  // samples between the ends of complete segments of successive boots

// SQL scripts, in order. Any thread.
std::span<const char* const> migrations();
// The same as files: "1.sql", "2.sql" and so on.
std::span<const base::EmbeddedFile> migration_files();

}  // namespace server::storage
