// One file after the other, in pieces.
#include "server/analysis/capsule/run_capsule.hpp"

#include <fmt/format.h>

#include <fstream>
#include <stdexcept>
#include <utility>

namespace server::analysis {
namespace {

constexpr std::size_t kCopiedPieceBytes = 256 * 1024;

storage::ExportQuery query_of(const storage::Run& run) {
  storage::ExportQuery query;
  query.run = run.id;
  return query;
}

}  // namespace

RunCapsule::RunCapsule(std::filesystem::path archive, std::filesystem::path samples, CapsuleRequest request)
    : request_{std::move(request)},
      samples_{std::move(samples)},
      folder_{fmt::format("run-{}/", request_.subject.run.id)},
      archive_{std::move(archive), request_.subject.run.started_at_us},
      csv_{request_.spans, query_of(request_.subject.run)},
      sqlite_{std::make_unique<storage::RunFile>(samples_, request_.store, request_.spans,
                                                 query_of(request_.subject.run))} {}

bool RunCapsule::advance(SQLite::Database& database) {
  switch (stage_) {
    case Stage::csv: advance_csv(database); break;
    case Stage::sqlite:
      if (!sqlite_->advance(database)) stage_ = Stage::sqlite_copy;
      break;
    case Stage::sqlite_copy: advance_copy(); break;
    case Stage::documents: add_document(); break;
    case Stage::seal: return archive_.seal();
  }
  return true;
}

void RunCapsule::begin(const std::string& name) {
  if (std::exchange(has_begun_, true)) return;
  archive_.begin(folder_ + name);
}

void RunCapsule::end(const std::string& title, const std::string& media_type) {
  ArchivedFile file = archive_.end();
  file.name.erase(0, folder_.size());
  files_.push_back({std::move(file), title, media_type});
  has_begun_ = false;
}

void RunCapsule::advance_csv(SQLite::Database& database) {
  begin("samples.csv");
  if (const auto piece = csv_.next(database)) return archive_.add(*piece);
  end("Samples, a line each", "text/csv");
  stage_ = Stage::sqlite;
}

void RunCapsule::advance_copy() {
  begin("samples.sqlite");
  std::ifstream file{samples_, std::ios::binary};
  file.seekg(static_cast<std::streamoff>(copied_bytes_));
  std::string piece(kCopiedPieceBytes, '\0');
  file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
  piece.resize(static_cast<std::size_t>(file.gcount()));
  if (file.bad()) throw std::runtime_error{fmt::format("cannot read {}", samples_.string())};
  archive_.add(piece);
  copied_bytes_ += piece.size();
  if (copied_bytes_ < std::filesystem::file_size(samples_)) return;
  end("Samples, events, commands and audit as a SQLite database", "application/vnd.sqlite3");
  stage_ = Stage::documents;
}

void RunCapsule::add_document() {
  if (documents_written_ < request_.documents.size()) {
    const CapsuleDocument& document = request_.documents[documents_written_++];
    begin(document.name);
    archive_.add(document.text);
    return end(document.title, document.media_type);
  }
  begin(kCrateFile);
  archive_.add(crate_json(request_.subject, files_));
  archive_.end();
  archive_.close();
  stage_ = Stage::seal;
}

}  // namespace server::analysis
