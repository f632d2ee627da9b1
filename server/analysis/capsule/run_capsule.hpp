// A run as an .eln archive: its samples as CSV and SQLite, documents about it, and RO-Crate metadata over all.
//
// In the folder run-<id>: samples.csv, samples.sqlite, the documents in the order given, ro-crate-metadata.json. The
// same run and documents give the same bytes. Works in slices on the thread that owns the database handle.
// Errors: throws std::runtime_error when the disk does not take it.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "server/analysis/capsule/archive_writer.hpp"
#include "server/analysis/capsule/crate_metadata.hpp"
#include "server/storage/export/csv_writer.hpp"
#include "server/storage/export/run_file.hpp"

namespace server::analysis {

struct CapsuleDocument {
  std::string name;  // "metrics.json"
  std::string title, media_type, text;
};

struct CapsuleRequest {
  CrateSubject subject;  // of a run that has ended
  std::vector<CapsuleDocument> documents;
  std::vector<storage::RecordedSpan> spans;
  std::string store;  // the station's database as a URI for ATTACH
};

class RunCapsule {
 public:
  // Both are written; `samples` (SQLite) is of no use afterwards.
  RunCapsule(std::filesystem::path archive, std::filesystem::path samples, CapsuleRequest request);

  // Works on for some 20 ms; false when the archive is whole. It is not synced.
  bool advance(SQLite::Database& database);

 private:
  enum class Stage : std::uint8_t { csv, sqlite, sqlite_copy, documents, seal };

  void begin(const std::string& name);
  void end(const std::string& title, const std::string& media_type);
  void advance_csv(SQLite::Database& database);
  void advance_copy();
  void add_document();

  CapsuleRequest request_;
  std::filesystem::path samples_;
  std::string folder_;
  ArchiveWriter archive_;
  storage::CsvWriter csv_;
  std::unique_ptr<storage::RunFile> sqlite_;
  Stage stage_ = Stage::csv;
  bool has_begun_ = false;
  std::uint64_t copied_bytes_ = 0;
  std::size_t documents_written_ = 0;
  std::vector<CrateFile> files_;
};

}  // namespace server::analysis
