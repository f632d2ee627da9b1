// Whatever columns the version of the database has.
#include "server/storage/export/run_facts.hpp"

#include <fmt/format.h>

#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace {

void add_facts(SQLite::Database& database, const char* table, const char* prefix, RunId run, Facts& facts) {
  SQLite::Statement query{database, fmt::format("SELECT * FROM {} WHERE run_id = ?", table)};
  bind_all(query, run);
  if (!query.executeStep()) return;
  for (int column = 0; column < query.getColumnCount(); ++column) {
    facts.emplace_back(fmt::format("{}{}", prefix, query.getColumnName(column)), query.getColumn(column).getString());
  }
}

template <class Enumerator>
std::string names() {
  std::string out;
  int number = 0;
  for (const std::string& text : enumerator_texts<Enumerator>()) {
    out += fmt::format("{}{} {}", number == 0 ? "" : ", ", number, text);
    ++number;
  }
  return out;
}

}  // namespace

Facts facts_of_run(SQLite::Database& database, RunId run) {
  Facts facts;
  add_facts(database, "run", "", run, facts);
  add_facts(database, "run_certificate", "certificate_", run, facts);
  return facts;
}

Facts enumerator_names() {
  Facts facts;
  station::for_each_batch_field_of<station::FieldKind::enumerator>(
      [&]<class Enumerator>(const station::BatchField<Enumerator>& field) {
        facts.emplace_back(fmt::format("{}s", field.name), names<Enumerator>());
      });
  return facts;
}

}  // namespace server::storage
