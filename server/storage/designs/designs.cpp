// SQL of the designs.
#include "server/storage/designs/designs.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/version.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/runtime/sha256.hpp"
#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/database/statement.hpp"
#include "server/storage/runs/run_queries.hpp"

namespace server::storage {
namespace asio = boost::asio;

namespace {

constexpr const char* kDesignColumns =
    "design_id, kind, name, notes, document, sha256, parent_id, model_id, options, made_with, made_by, made_at_us";

std::optional<DesignId> optional_design(const SQLite::Column& column) {
  return column.isNull() ? std::nullopt : std::optional{column.getInt64()};
}

Design design_of(SQLite::Statement& row) {
  Design design;
  design.id = row.getColumn(0).getInt64();
  design.made.kind = design_kind_from(row.getColumn(1).getString()).value_or(DesignKind::model);
  design.made.name = row.getColumn(2).getString();
  design.made.notes = row.getColumn(3).getString();
  design.made.document = row.getColumn(4).getString();
  design.sha256 = row.getColumn(5).getString();
  design.made.parent = optional_design(row.getColumn(6));
  design.made.model = optional_design(row.getColumn(7));
  design.made.options = row.getColumn(8).getString();
  design.made_with = row.getColumn(9).getString();
  design.made_by = row.getColumn(10).getString();
  design.made_at_us = row.getColumn(11).getInt64();
  return design;
}

void add_sources(SQLite::Database& database, Design& design) {
  SQLite::Statement rows{database, "SELECT run_id, span FROM design_source WHERE design_id = ? ORDER BY source"};
  bind_all(rows, design.id);
  while (rows.executeStep()) {
    const SQLite::Column span = rows.getColumn(1);
    design.made.sources.push_back(
        {rows.getColumn(0).getInt64(), span.isNull() ? std::nullopt : std::optional{std::uint32_t{span.getUInt()}}});
  }
}

std::optional<Design> read_design(SQLite::Database& database, DesignId id) {
  SQLite::Statement row{database, fmt::format("SELECT {} FROM design WHERE design_id = ?", kDesignColumns)};
  bind_all(row, id);
  if (!row.executeStep()) return std::nullopt;
  Design design = design_of(row);
  add_sources(database, design);
  return design;
}

Result<void> check_relative(SQLite::Database& database, const char* what, std::optional<DesignId> id, DesignKind kind) {
  if (!id) return {};
  SQLite::Statement row{database, "SELECT kind FROM design WHERE design_id = ?"};
  bind_all(row, *id);
  if (!row.executeStep()) return fail(ErrorCode::invalid, fmt::format("{} is {}, there is no such design", what, *id));
  const std::string found = row.getColumn(0).getString();
  if (found == text(kind)) return {};
  return fail(ErrorCode::invalid, fmt::format("{} is {}, which is a {}; give a {}", what, *id, found, text(kind)));
}

Result<void> check_relatives(SQLite::Database& database, const DesignRequest& request) {
  if (auto parent = check_relative(database, "parent_id", request.parent, request.kind); !parent) return parent;
  if (auto model = check_relative(database, "model_id", request.model, DesignKind::model); !model) return model;
  for (const DesignSource& source : request.sources) {
    if (read_run_state(database, source.run)) continue;
    return fail(ErrorCode::invalid, fmt::format("there is no run {} for a design to be found from", source.run));
  }
  return {};
}

void insert_sources(SQLite::Database& database, const Design& design) {
  SQLite::Statement add{database, "INSERT INTO design_source (design_id, source, run_id, span) VALUES (?, ?, ?, ?)"};
  std::int64_t number = 0;
  for (const DesignSource& source : design.made.sources) execute(add, design.id, number++, source.run, source.span);
}

Result<void> insert_design(SQLite::Database& database, Design& design, const station::Author& by) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  if (auto checked = check_relatives(database, design.made); !checked) return checked;
  SQLite::Statement add{database,
                        "INSERT INTO design (kind, name, notes, document, sha256, parent_id, model_id,"
                        " options, made_with, made_by, made_at_us) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"};
  const DesignRequest& made = design.made;
  execute(add, text(made.kind), made.name, made.notes, made.document, design.sha256, made.parent, made.model,
          made.options, design.made_with, design.made_by, design.made_at_us);
  design.id = database.getLastInsertRowid();
  insert_sources(database, design);
  station::AuditNote note;
  note.by = by;
  note.action = "design.stored";
  note.subject = fmt::format("{}", design.id);
  note.detail = station::audit_detail({{"kind", text(made.kind)}, {"name", made.name}, {"sha256", design.sha256}});
  AuditChain{database}.append(note);
  transaction.commit();
  return {};
}

std::vector<RunId> read_runs_made_with(SQLite::Database& database, DesignId id) {
  SQLite::Statement rows{database,
                         "SELECT DISTINCT run_id FROM run JOIN design_sent USING (robot_id, controller_checksum)"
                         " WHERE (design_id = ?1 OR design_id IN (SELECT design_id FROM design WHERE model_id = ?1))"
                         " AND started_at_us >= first_at_us AND state <> 'discarded' ORDER BY run_id DESC LIMIT ?2"};
  bind_all(rows, id, static_cast<std::int64_t>(kMostRunsMadeWith));
  std::vector<RunId> runs;
  while (rows.executeStep()) runs.push_back(rows.getColumn(0).getInt64());
  return runs;
}

}  // namespace

asio::awaitable<Result<Design>> Designs::store(DesignRequest request, station::Author by) {
  by.at_us = clock_.utc_us();
  Design design;
  design.sha256 = runtime::sha256_of(request.document);
  design.made = std::move(request);
  design.made_with = base::version();
  design.made_by = by.actor;
  design.made_at_us = by.at_us;
  auto job = [&design, &by](Database& database) -> Result<void> {
    try {
      return insert_design(database.handle(), design, by);
    } catch (const SQLite::Exception& error) {
      return fail(ErrorCode::unavailable,
                  fmt::format("the design could not be stored: {}; try again", runtime::text_of(error)), "not_stored");
    }
  };
  const Result<void> stored = co_await recorder_.on_disk(std::move(job));
  if (!stored) co_return std::unexpected{stored.error()};
  co_return design;
}

asio::awaitable<Result<Design>> Designs::find(DesignId id) {
  auto query = [id](SQLite::Database& database) { return read_design(database, id); };
  auto found = co_await reader_.ask(std::move(query));
  if (!found) co_return fail(ErrorCode::not_found, fmt::format("there is no design {}", id), "no_such_design");
  co_return std::move(*found);
}

asio::awaitable<std::vector<Design>> Designs::list(DesignFilter filter) {
  auto query = [filter](SQLite::Database& database) {
    const SQLite::Transaction moment{database};
    SQLite::Statement rows{
        database,
        fmt::format("SELECT {} FROM design WHERE (?1 IS NULL OR kind = ?1) AND (?2 = 0 OR design_id < ?2)"
                    " AND (?3 IS NULL OR design_id IN (SELECT design_id FROM design_source WHERE run_id = ?3))"
                    " ORDER BY design_id DESC LIMIT ?4",
                    kDesignColumns)};
    const auto kind = filter.kind ? std::optional<std::string>{text(*filter.kind)} : std::nullopt;
    bind_all(rows, kind, filter.before, filter.run, static_cast<std::int64_t>(filter.limit));
    std::vector<Design> designs;
    while (rows.executeStep()) designs.push_back(design_of(rows));
    for (Design& design : designs) add_sources(database, design);
    return designs;
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<Result<void>> Designs::note_sent(DesignId id, station::RobotId robot_id,
                                                 std::uint32_t controller_checksum) {
  auto job = [id, robot_id = std::move(robot_id), controller_checksum,
              now_us = clock_.utc_us()](Database& database) -> Result<void> {
    try {
      SQLite::Statement note{database.handle(),
                             "INSERT OR IGNORE INTO design_sent (design_id, robot_id, controller_checksum, first_at_us)"
                             " VALUES (?, ?, ?, ?)"};
      execute(note, id, robot_id, controller_checksum, now_us);
      return {};
    } catch (const SQLite::Exception& error) {
      return fail(ErrorCode::unavailable,
                  fmt::format("nothing was sent: that design {} goes to {} could not be stored: {}; try again", id,
                              robot_id, runtime::text_of(error)),
                  "not_stored");
    }
  };
  co_return co_await recorder_.on_disk(std::move(job));
}

asio::awaitable<std::vector<RunId>> Designs::runs_made_with(DesignId id) {
  auto query = [id](SQLite::Database& database) { return read_runs_made_with(database, id); };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<std::vector<ControllerOfRun>> Designs::controllers_of(RunId run) {
  auto query = [run](SQLite::Database& database) {
    const SQLite::Transaction moment{database};
    SQLite::Statement rows{database,
                           "SELECT design_id FROM design_sent JOIN run USING (robot_id, controller_checksum)"
                           " WHERE run_id = ? AND started_at_us >= first_at_us ORDER BY design_id DESC LIMIT ?"};
    bind_all(rows, run, static_cast<std::int64_t>(kMostControllersOfRun));
    std::vector<ControllerOfRun> found;
    while (rows.executeStep()) {
      auto controller = read_design(database, rows.getColumn(0).getInt64());
      if (!controller) continue;
      auto model = controller->made.model ? read_design(database, *controller->made.model) : std::nullopt;
      found.push_back({std::move(*controller), std::move(model)});
    }
    return found;
  };
  co_return co_await reader_.ask(std::move(query));
}

asio::awaitable<std::vector<Design>> Designs::ancestors(DesignId id) {
  auto query = [id](SQLite::Database& database) {
    const SQLite::Transaction moment{database};
    std::vector<Design> line;
    auto next = read_design(database, id);
    while (next && next->made.parent && line.size() < kMostAncestors) {
      next = read_design(database, *next->made.parent);
      if (next) line.push_back(*next);
    }
    return line;
  };
  co_return co_await reader_.ask(std::move(query));
}

}  // namespace server::storage
