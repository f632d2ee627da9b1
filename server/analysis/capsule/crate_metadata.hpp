// The metadata of a run's archive: RO-Crate 1.1, JSON-LD that describes the run, its files and what made them.
//
// https://www.researchobject.org/ro-crate/1.1 and the profile of the ELN consortium for .eln archives: one folder with
// ro-crate-metadata.json, and a SHA-256 of each other file. Pure.
#pragma once

#include <span>
#include <string>

#include "server/analysis/capsule/archive_writer.hpp"
#include "server/storage/runs/run.hpp"

namespace server::analysis {

inline constexpr const char* kCrateFile = "ro-crate-metadata.json";

struct CrateFile {
  ArchivedFile file;  // its name within the folder
  std::string title, media_type;
};

struct CrateSubject {
  storage::Run run;
  std::string program;       // its version
  std::string architecture;  // of the machine that made the archive, as uname says
};

std::string crate_json(const CrateSubject& subject, std::span<const CrateFile> files);

std::string architecture();  // of this machine

}  // namespace server::analysis
