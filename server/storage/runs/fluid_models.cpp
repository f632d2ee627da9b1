// SQL of the models of fluids: one row for each change.
#include "server/storage/runs/fluid_models.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "server/runtime/exceptions.hpp"
#include "server/station/state/audit_details.hpp"
#include "server/storage/audit/audit_chain.hpp"
#include "server/storage/database/database.hpp"
#include "server/storage/database/statement.hpp"

namespace server::storage {
namespace asio = boost::asio;

namespace {

constexpr const char* kModelColumns =
    "fluid, set_at_us, set_by, gain_1_m_s, gain_2_m_s, gain_3_m_s, gain_4_m_s, time_constant_1_s, time_constant_2_s,"
    " time_constant_3_s, time_constant_4_s, fit_error, document, assumed_because";
constexpr int kFirstGain = 3;  // in that order, as are the next
constexpr int kFirstTimeConstant = kFirstGain + static_cast<int>(station::kFluidModelSections);
constexpr int kFitError = kFirstTimeConstant + static_cast<int>(station::kFluidModelSections);

using Named = std::pair<std::string, station::FluidModel>;

// The newest row of each fluid, unless it says that the fluid has none.
std::vector<Named> read_in_force(SQLite::Database& database) {
  std::vector<Named> models;
  SQLite::Statement rows{database, fmt::format("SELECT {} FROM fluid_model WHERE model_row IN"
                                               " (SELECT max(model_row) FROM fluid_model GROUP BY fluid)"
                                               " AND gain_1_m_s IS NOT NULL ORDER BY fluid",
                                               kModelColumns)};
  while (rows.executeStep()) {
    auto& [fluid, model] = models.emplace_back();
    fluid = rows.getColumn(0).getString();
    model.set_at_us = rows.getColumn(1).getInt64();
    model.set_by = rows.getColumn(2).getString();
    for (std::size_t i = 0; i < station::kFluidModelSections; ++i) {
      const int column = static_cast<int>(i);
      model.gain_m_s[i] = float_or_nan(rows.getColumn(kFirstGain + column));
      model.time_constant_s[i] = float_or_nan(rows.getColumn(kFirstTimeConstant + column));
    }
    model.fit_error = rows.getColumn(kFitError).getDouble();
    model.document = rows.getColumn(kFitError + 1).getString();
    model.assumed_because = rows.getColumn(kFitError + 2).getString();
  }
  return models;
}

// Null: the fluid has none from now on.
void append(SQLite::Database& database, const std::string& fluid, const station::FluidModel* model,
            const station::Author& by) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  SQLite::Statement add{
      database,
      fmt::format("INSERT INTO fluid_model ({}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", kModelColumns)};
  bind_all(add, fluid, by.at_us, by.actor);
  if (model != nullptr) {
    int index = kFirstGain;
    for (const auto& [name, value] : parameters_of(*model)) bind_value(add, ++index, value);
    bind_value(add, ++index, model->fit_error);
    bind_value(add, ++index, model->document);
  }
  bind_value(add, kFitError + 3, model != nullptr ? model->assumed_because : std::string{});
  add.exec();
  station::AuditNote note;
  note.by = by;
  note.action = model != nullptr ? "fluid.model_set" : "fluid.model_removed";
  note.subject = fluid;
  if (model != nullptr) note.detail = station::model_detail(*model);
  AuditChain{database}.append(note);
  transaction.commit();
}

void append_sent(SQLite::Database& database, const std::string& robot_id, const std::string& fluid,
                 const station::FluidModel& model, const station::Author& by) {
  SQLite::Transaction transaction{database, SQLite::TransactionBehavior::IMMEDIATE};
  AuditChain{database}.append({by, robot_id, "robot.model_sent", fluid, station::model_detail(model)});
  transaction.commit();
}

// Returned to the caller as an error: a full disk does not end the station.
template <class Append>
Result<void> stored(Append append) {
  try {
    append();
    return {};
  } catch (const SQLite::Exception& error) {
    return fail(ErrorCode::unavailable,
                fmt::format("the model could not be stored: {}; try again", runtime::text_of(error)), "not_stored");
  }
}

}  // namespace

asio::awaitable<void> FluidModels::load() {
  auto job = [](Database& database) { return read_in_force(database.handle()); };
  std::vector<Named> models = co_await recorder_.on_disk(std::move(job));
  for (auto& [fluid, model] : models) list_.put(fluid, std::move(model));
}

asio::awaitable<Result<station::FluidModel>> FluidModels::set(std::string fluid, station::FluidModel model,
                                                              station::Author by) {
  by.at_us = clock_.utc_us();
  model.set_by = by.actor;
  model.set_at_us = by.at_us;
  auto job = [fluid, model, by](Database& database) {
    return stored([&] { append(database.handle(), fluid, &model, by); });
  };
  const Result<void> done = co_await recorder_.on_disk(std::move(job));
  if (!done) co_return std::unexpected{done.error()};
  list_.put(fluid, model);
  co_return model;
}

asio::awaitable<Result<void>> FluidModels::note_sent(std::string robot_id, std::string fluid, station::FluidModel model,
                                                     station::Author by) {
  by.at_us = clock_.utc_us();
  auto job = [=](Database& database) {
    return stored([&] { append_sent(database.handle(), robot_id, fluid, model, by); });
  };
  const Result<void> done = co_await recorder_.on_disk(std::move(job));
  co_return done;
}

asio::awaitable<Result<void>> FluidModels::remove(std::string fluid, station::Author by) {
  if (list_.find(fluid) == nullptr) {
    co_return fail(ErrorCode::not_found, fmt::format("the fluid '{}' has no model", fluid), "no_model");
  }
  by.at_us = clock_.utc_us();
  auto job = [fluid, by](Database& database) { return stored([&] { append(database.handle(), fluid, nullptr, by); }); };
  const Result<void> done = co_await recorder_.on_disk(std::move(job));
  if (done) list_.remove(fluid);
  co_return done;
}

}  // namespace server::storage
