// A part is a member, and a line in each function that concerns it.
#include "server/recording/recording_parts.hpp"

#include <spdlog/spdlog.h>

#include <functional>

#include "server/recording/run_store.hpp"

namespace server {
namespace asio = boost::asio;

RecordingParts::RecordingParts(asio::io_context& loop, Clock& clock, WorkerThread& disk, WorkerThread& readers,
                               WorkerThread& checkpoints, const RecorderOptions& options)
    : recorder{loop, clock, disk, checkpoints, options},
      reader{options.path, readers},
      certifier{clock, recorder, reader},
      runs{clock, recorder, reader, certifier},
      markers{clock, recorder, reader},
      history{options.path, recorder, readers},
      path_{options.path} {}

void RecordingParts::connect(Station& station) {
  station.add_sink(recorder);
  station.add_sink(runs);
  recorder.set_on_durable(std::bind_front(&Station::on_durable, &station));
  recorder.set_on_missing(std::bind_front(&Station::request_resend, &station));
  recorder.set_on_missing_events(std::bind_front(&Station::request_event_resend, &station));
}

asio::awaitable<RestoredState> RecordingParts::open() {
  RestoredState restored = co_await recorder.open();
  co_await runs.load();
  co_return restored;
}

void RecordingParts::spawn(TaskGroup& tasks) {
  tasks.spawn("recorder", recorder.run());
  tasks.spawn("checkpoints", recorder.run_checkpoints());
  tasks.spawn("certifier", certifier.run());
}

void RecordingParts::close() {
  reader.close();
  recorder.close();
  if (!runs.any_open()) return;
  try {
    Database database{path_};
    RunStore{database, {}}.interrupt();
    database.checkpoint();
  } catch (const std::exception& error) {  // the next start does it
    spdlog::warn("the open runs could not be interrupted: {}", error.what());
  }
}

}  // namespace server
