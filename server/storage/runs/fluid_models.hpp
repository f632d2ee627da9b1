// The models of fluids in the database, and in memory those that are in force.
//
// A model is a row that stays; the newest of a fluid is in force, and one without numbers says that the fluid has none.
// Loop thread; SQL on the disk thread. Clock and recorder outlive it.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <string>

#include "server/runtime/clock.hpp"
#include "server/runtime/result.hpp"
#include "server/station/state/audit_note.hpp"
#include "server/station/state/fluid_model.hpp"
#include "server/storage/ingest/recorder.hpp"

namespace server::storage {

class FluidModels {
 public:
  FluidModels(runtime::Clock& clock, Recorder& recorder) : clock_{clock}, recorder_{recorder} {}

  // Reads those in force; before everything else.
  boost::asio::awaitable<void> load();

  const station::FluidModelList& in_force() const { return list_; }

  // In force when it is on disk, with its entry in the audit; author and time are set here. The model is a checked one,
  // the fluid a listed one. unavailable when the disk cannot be written.
  boost::asio::awaitable<Result<station::FluidModel>> set(std::string fluid, station::FluidModel model,
                                                          station::Author by);

  // Writes into the audit that somebody sends one robot this model of the fluid. unavailable when the disk cannot be
  // written.
  boost::asio::awaitable<Result<void>> note_sent(std::string robot_id, std::string fluid, station::FluidModel model,
                                                 station::Author by);

  // The fluid has no model from then on. not_found when it has none.
  boost::asio::awaitable<Result<void>> remove(std::string fluid, station::Author by);

 private:
  runtime::Clock& clock_;
  Recorder& recorder_;
  station::FluidModelList list_;
};

}  // namespace server::storage
