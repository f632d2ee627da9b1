// Databases of earlier versions, made again of the dumps in tests/data/recording.
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace server {

inline std::string content_of(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream{path, std::ios::binary}.rdbuf();
  return text.str();
}

inline std::string test_data(const std::string& name) {
  return content_of(std::filesystem::path{TEST_DATA_DIR} / "recording" / name);
}

inline void make_database(const std::filesystem::path& path, const std::string& dump) {
  SQLite::Database database{path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE};
  database.exec(test_data(dump));
}

}  // namespace server
