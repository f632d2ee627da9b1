// A child of this program that reads a file which somebody else may have made, under limits that grow with the file.
#pragma once

#include <filesystem>
#include <optional>

namespace server::cli {

struct ForeignFile {
  std::filesystem::path file;
  std::filesystem::path draft;  // the database that is written meanwhile; empty: none
};

// Forks; called while there is one thread. In the child returns none, and the command goes on there with limited
// memory, processor time, file size and descriptors. In this process returns the exit status of the child. Whichever of
// the two outlives the other removes the draft. Throws std::runtime_error that names the limit when the child was
// ended.
std::optional<int> read_in_child(const ForeignFile& foreign);

}  // namespace server::cli
