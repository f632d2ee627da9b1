// The tables of the recording, as numbered migrations; docs/database.md explains them to people.
//
// Migration n brings a database from user_version n - 1 to n. A released migration is never changed: a new one is
// added below it.
#pragma once

#include <cstdint>
#include <span>

namespace server {

constexpr std::int32_t kApplicationId = 0x5268656f;  // "Rheo"
constexpr std::int64_t kMaxSegmentSamples = 100;     // the views and queries look this far back for a segment's begin

// SQL scripts, in order. Those after the first one are in files of their own.
std::span<const char* const> migrations();
extern const char* const kSecondSchema;
extern const char* const kThirdSchema;
extern const char* const kFourthSchema;
extern const char* const kFifthSchema;
extern const char* const kSixthSchema;
extern const char* const kSeventhSchema;

}  // namespace server
