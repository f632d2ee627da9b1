// Feeds any messages of a client to a Foxglove session with two robots: what waits stays bounded, every answer is JSON,
// and a subscription gets the samples of its channel and of no other.
//
// The first byte of each line is 'b' for a binary message, anything else for a text; the rest of the line is the
// message.
#include <cstdlib>
#include <sstream>

#include "server/live/foxglove/feed.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace live::foxglove;

void require(bool condition) {
  if (!condition) std::abort();
}

station::RobotState robot(const char* id) {
  station::RobotState state;
  state.id = id;
  return state;
}

station::SampleBatch batch(const char* id) {
  station::SampleBatch made;
  made.robot_id = id;
  made.boot_id = 1;
  made.samples.resize(2);
  return made;
}

void talk(const std::string& text) {
  static boost::asio::io_context loop;
  static VirtualClock clock{loop};
  Feed feed;
  Session session{loop, clock, std::nullopt};
  session.begin("fuzz", "0");
  feed.add(session, {{"a", robot("a")}, {"b", robot("b")}});
  std::istringstream lines{text};
  for (std::string line; std::getline(lines, line);) {
    const std::string message = line.substr(std::min<std::size_t>(line.size(), 1));
    if (line.starts_with('b')) {
      session.on_binary(message);
    } else {
      session.on_text(message);
    }
    feed.on_samples(robot("a"), batch("a"));
  }
  require(session.queue().size() <= OutgoingQueue::kMaxData + OutgoingQueue::kMaxStatuses + 4);
  const auto subscribed = session.subscription("a", Topic::telemetry);
  while (const auto outgoing = session.queue().pop()) {
    require(nlohmann::json::accept(*outgoing->body));
  }
  feed.on_samples(robot("a"), batch("a"));
  const auto sample = session.queue().pop();
  require(sample.has_value() == subscribed.has_value());
  require(!sample || (sample->head && *sample->head == data_head(*subscribed, 0)));
  feed.remove(session);
}

}  // namespace
}  // namespace server

int fuzz::foxglove(const std::uint8_t* data, std::size_t size) {
  server::talk({reinterpret_cast<const char*>(data), size});
  return 0;
}
