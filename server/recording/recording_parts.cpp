// A part is a member, and a line in each function that concerns it.
#include "server/recording/recording_parts.hpp"

#include <functional>

namespace server {
namespace asio = boost::asio;

RecordingParts::RecordingParts(asio::io_context& loop, Clock& clock, WorkerThread& disk, WorkerThread& readers,
                               WorkerThread& exports_worker, const RecorderOptions& options)
    : recorder{loop, clock, disk, options},
      runs{clock, recorder},
      history{options.path, recorder, readers},
      exports{options.path, recorder, exports_worker},
      path_{options.path} {}

void RecordingParts::connect(Station& station) {
  station.add_sink(recorder);
  station.add_sink(runs);
  recorder.set_on_durable(std::bind_front(&Station::on_durable, &station));
  recorder.set_on_missing(std::bind_front(&Station::request_resend, &station));
}

asio::awaitable<RestoredState> RecordingParts::open() {
  RestoredState restored = co_await recorder.open();
  std::error_code ignored;
  std::filesystem::remove_all(exports_folder(), ignored);  // what a crash left
  co_await runs.load();
  co_return restored;
}

void RecordingParts::spawn(TaskGroup& tasks) { tasks.spawn("recorder", recorder.run()); }

void RecordingParts::close() { recorder.close(); }

}  // namespace server
