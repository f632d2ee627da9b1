// The live messages for browsers: a sink of the station that writes each message once and queues the same text for
// every subscriber.
//
// Loop thread. Outlives its subscribers. Never waits for a subscriber: queues are bounded.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "server/live/subscriber.hpp"
#include "server/runtime/clock.hpp"
#include "server/station/state/station_sink.hpp"

namespace server::live {

// A page gets the changes of the robots that it watches at once, except small changes of state (with the next stamp, or
// twice a second while only numbers advance) and samples (50 ms of them at a time). A page that has named its robots
// gets the rest with the next stamp only: the large changes of the other robots, and one `log` of all events and
// commands. So a page costs the same few messages a second however many robots there are. A lease that was renewed,
// some ten times a second, is not published.
class LiveFeed final : public station::StationSink {
 public:
  explicit LiveFeed(runtime::Clock& clock) : clock_{clock} {}

  // Every 100 ms: a stamp, and what waited for it. Until cancelled.
  boost::asio::awaitable<void> run();

  void add(Subscriber& subscriber);
  void remove(Subscriber& subscriber);
  // Whose samples and every change of state it gets from now on; before the first call, those of all.
  void watch(Subscriber& subscriber, const std::set<station::RobotId>& robots);

  void publish_run(nlohmann::json run);
  void publish_experiment(nlohmann::json experiment);

  std::size_t robots() const { return robots_.size(); }  // of which it keeps something

  void on_robot(const station::RobotState& robot) override;
  void on_samples(const station::RobotState& robot, const station::SampleBatch& batch) override;
  void on_event(const station::RobotState& robot, const station::RobotEvent& event) override;
  void on_command(const station::CommandRecord& record) override;
  bool watches(const station::RobotId& robot) const override;

 private:
  using Subscribers = std::vector<Subscriber*>;
  // Of a robot's state what is published to all, and at once to those who watch it.
  using Headline = std::tuple<station::LinkState, station::BootId, protocol::Mode, protocol::SubState, std::uint64_t,
                              station::CommandId, bool>;

  // What is still to be published of a robot's state, and to whom.
  struct Change {
    station::RobotState state;
    bool to_watchers;
    bool to_others;
  };
  struct Robot {
    std::optional<Headline> headline;  // as it was published; none yet: it is watched and has reported nothing
    Subscribers watchers;              // among those that chose
    std::optional<Change> change;      // that is still to be published
    std::optional<station::RobotState> published;  // to its watchers, last; none: somebody has begun to watch it since
    std::int64_t published_at_us = 0;              // steady
    std::optional<station::SampleBatch> gathered;  // under 50 ms of samples
    std::int64_t gathered_since_us = 0;            // steady
    std::string renewal_refusal;                   // why its last lease was not renewed; empty: it was
  };

  void publish_to_all(const char* type, nlohmann::json value);
  static Headline headline(const station::RobotState& robot);
  bool has_subscribers() const { return !watch_all_.empty() || !filtered_.empty(); }
  bool is_watched(const Robot& robot) const { return !watch_all_.empty() || !robot.watchers.empty(); }
  boost::asio::awaitable<void> publish_changed();
  void on_headline(Robot& robot, const station::RobotState& state);
  Change& change_of(Robot& robot, const station::RobotState& state);
  bool is_due(const Robot& robot, const Change& change) const;
  std::vector<station::RobotId> take_due();
  void gather(Robot& robot, const station::SampleBatch& batch);
  std::size_t publish_robot(Robot& robot, const Change& change);  // returns to how many
  void publish_gathered(Robot& robot);
  void publish_late_samples();
  void publish_log();
  bool is_news(const station::CommandRecord& record);

  runtime::Clock& clock_;
  Subscribers watch_all_;
  std::map<Subscriber*, std::set<station::RobotId>> filtered_;  // that said what they watch
  std::unordered_map<station::RobotId, Robot> robots_;
  std::vector<station::RobotId> changed_;         // that have a change
  std::vector<station::RobotEvent> events_;       // of the next log
  std::vector<station::CommandRecord> commands_;  // of the next log; of each command the newest record
};

}  // namespace server::live
