// How many export files are written at a time: each is a program that reads the database and fills the disk.
//
//   if (const auto may = slots.may_begin(); !may) co_return std::unexpected{may.error()};
//   const runtime::Counted slot{slots.taken};   // for as long as the file is written
//
// Loop thread.
#pragma once

#include "server/runtime/result.hpp"
#include "server/runtime/worker.hpp"

namespace server::storage {

inline constexpr int kMostExportFiles = 4;

struct ExportSlots {
  int taken = 0;
  Result<void> may_begin() const;  // unavailable (busy)
};

}  // namespace server::storage
