// Writes what the station says and fans it out.
#include "server/live/live_feed.hpp"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>
#include <ranges>
#include <utility>

#include "server/live/state_json.hpp"

namespace server::live {
namespace asio = boost::asio;
using nlohmann::json;

namespace {
constexpr std::int64_t kStampIntervalUs = 100'000;
constexpr std::size_t kRobotsAStamp = 200;  // that are published before it; the others after the next
constexpr std::size_t kWorkInATurn = 60;    // of the loop, in messages put into queues
constexpr std::size_t kWorkOfARobot = 12;   // to write its state
constexpr std::int64_t kGatheredUs = 50'000;
constexpr std::size_t kMaxLog = 64;  // events and commands in one message
constexpr std::int64_t kProgressIntervalUs = 500'000;

std::int64_t length_us(const station::SampleBatch& batch) {
  return static_cast<std::int64_t>(batch.samples.size()) * batch.context.period_us;
}

bool continues(const station::SampleBatch& before, const station::SampleBatch& next) {
  return next.boot_id == before.boot_id && next.first_seq == before.next_seq() && next.context == before.context &&
         next.first_robot_time_us == before.first_robot_time_us + static_cast<std::uint64_t>(length_us(before));
}

// Only numbers have advanced that do so all the time: samples with their "±", times, the estimate of the clock.
bool is_progress(const station::RobotState& before, const station::RobotState& now) {
  station::SampleContext context = now.context;
  context.position_sd_m = before.context.position_sd_m;
  return before.context == context && before.control == now.control && before.reservation == now.reservation &&
         before.fluid == now.fluid && before.model == now.model && before.status == now.status &&
         before.parameters_checksum == now.parameters_checksum && before.changed_limits == now.changed_limits &&
         before.controller_checksum == now.controller_checksum && before.invalid_values == now.invalid_values &&
         before.events_left_out == now.events_left_out && before.peer == now.peer &&
         before.retired_at_us == now.retired_at_us;
}

// A message to some: its text is written for the first subscriber, and once for all.
template <class Write>
class Message {
 public:
  explicit Message(Write write) : write_{std::move(write)} {}
  const LiveText& text() {
    if (text_ == nullptr) text_ = std::make_shared<const std::string>(write_());
    return text_;
  }
  void push(const auto& to, bool droppable) {
    for (Subscriber* one : to) one->push(text(), droppable);
  }

 private:
  Write write_;
  LiveText text_;
};

template <class Values>
json list(const Values& values) {
  json all = json::array();
  for (const auto& value : values) all.push_back(to_json(value));
  return all;
}
}  // namespace

// Without browsers nothing is collected; a new one gets the state of the station first.
void LiveFeed::add(Subscriber& subscriber) {
  if (!has_subscribers()) {
    robots_.clear();
    changed_.clear();
    events_.clear();
    commands_.clear();
  }
  watch_all_.push_back(&subscriber);
}

void LiveFeed::remove(Subscriber& subscriber) {
  if (std::erase(watch_all_, &subscriber) > 0) {
    for (auto& [id, robot] : robots_) {
      if (!is_watched(robot)) robot.gathered.reset();
    }
  }
  const auto chose = filtered_.extract(&subscriber);
  if (!chose) return;
  for (const station::RobotId& id : chose.mapped()) {
    const auto robot = robots_.find(id);
    if (robot == robots_.end()) continue;
    std::erase(robot->second.watchers, &subscriber);
    if (!is_watched(robot->second)) robot->second.gathered.reset();
    if (robot->second.watchers.empty() && !robot->second.headline) robots_.erase(robot);  // there may be no such robot
  }
}

void LiveFeed::watch(Subscriber& subscriber, const std::set<station::RobotId>& robots) {
  remove(subscriber);
  filtered_.emplace(&subscriber, robots);
  for (const station::RobotId& id : robots) {
    Robot& robot = robots_[id];
    robot.watchers.push_back(&subscriber);
    robot.published.reset();
  }
}

asio::awaitable<void> LiveFeed::run() {
  for (std::int64_t due_us = clock_.steady_us();;) {
    due_us = std::max(due_us + kStampIntervalUs, clock_.steady_us());
    co_await clock_.sleep_until(due_us);
    publish_late_samples();
    co_await publish_changed();
    publish_log();
    Message stamp{[&] { return dump({{"type", "stamp"}, {"stamp_us", clock_.steady_us()}}); }};
    stamp.push(watch_all_, true);
    stamp.push(std::views::keys(filtered_), true);
  }
}

// A few robots in each turn of the loop. Of those that change meanwhile, the ones that it has passed wait for the next
// stamp; so do the last of very many, for the stamp itself must not be late.
asio::awaitable<void> LiveFeed::publish_changed() {
  std::size_t work = 0;
  const std::vector<station::RobotId> due = take_due();
  for (const station::RobotId& id : due) {
    const auto robot = robots_.find(id);
    if (robot == robots_.end() || !robot->second.change) continue;
    work += kWorkOfARobot + publish_robot(robot->second, *std::exchange(robot->second.change, std::nullopt));
    if (work < kWorkInATurn) continue;
    work = 0;
    co_await asio::post(asio::use_awaitable);
  }
}

bool LiveFeed::is_due(const Robot& robot, const Change& change) const {
  if (change.to_others || !robot.published) return true;
  return clock_.steady_us() - robot.published_at_us >= kProgressIntervalUs ||
         !is_progress(*robot.published, change.state);
}

// The others wait for a later stamp.
std::vector<station::RobotId> LiveFeed::take_due() {
  std::vector<station::RobotId> due;
  const auto is_taken = [&](const station::RobotId& id) {
    if (due.size() == kRobotsAStamp) return false;
    const auto robot = robots_.find(id);
    if (robot != robots_.end() && robot->second.change && !is_due(robot->second, *robot->second.change)) return false;
    due.push_back(id);
    return true;
  };
  std::erase_if(changed_, is_taken);
  return due;
}

LiveFeed::Headline LiveFeed::headline(const station::RobotState& robot) {
  return {robot.link,
          robot.boot_id,
          robot.context.mode,
          robot.context.sub_state,
          robot.context.emergency_id,
          robot.pending_stop.value_or(0),
          robot.stop_path.is_open};
}

std::size_t LiveFeed::publish_robot(Robot& robot, const Change& change) {
  const station::RobotState& state = change.state;
  if (change.to_watchers) {
    robot.published = state;
    robot.published_at_us = clock_.steady_us();
  }
  Message message{[&] { return dump({{"type", "robot"}, {"robot", to_json(state)}}); }};
  std::size_t published = 0;
  const auto push = [&](Subscriber* to) {
    to->push_state(state.id, message.text());
    ++published;
  };
  if (change.to_watchers) {
    std::ranges::for_each(watch_all_, push);
    std::ranges::for_each(robot.watchers, push);
  }
  if (!change.to_others) return published;
  for (const auto& [one, watched] : filtered_) {
    if (!watched.contains(state.id)) push(one);
  }
  return published;
}

void LiveFeed::publish_run(json run) { publish_to_all("run", std::move(run)); }

void LiveFeed::publish_experiment(json experiment) { publish_to_all("experiment", std::move(experiment)); }

// {"type": "run", "run": {…}}
void LiveFeed::publish_to_all(const char* type, json value) {
  Message message{[&] { return dump({{"type", type}, {type, std::move(value)}}); }};
  message.push(watch_all_, false);
  message.push(std::views::keys(filtered_), false);
}

// With the newest state.
LiveFeed::Change& LiveFeed::change_of(Robot& robot, const station::RobotState& state) {
  if (!robot.change) {
    robot.change.emplace();
    changed_.push_back(state.id);
  }
  robot.change->state = state;
  return *robot.change;
}

// Samples from before a large change are published before it.
void LiveFeed::on_headline(Robot& robot, const station::RobotState& state) {
  robot.headline = headline(state);
  publish_gathered(robot);
  publish_robot(robot, {state, true, false});
  Change& change = change_of(robot, state);
  change.to_watchers = false;
  change.to_others = true;
}

void LiveFeed::on_robot(const station::RobotState& state) {
  if (!has_subscribers()) return;
  Robot& robot = robots_[state.id];
  if (robot.headline != headline(state)) {
    on_headline(robot, state);
  } else if (is_watched(robot) || robot.change) {
    change_of(robot, state).to_watchers = true;
  }
}

void LiveFeed::on_samples(const station::RobotState& state, const station::SampleBatch& batch) {
  if (!has_subscribers()) return;
  Robot& robot = robots_[state.id];
  const bool is_headline = robot.headline != headline(state);
  if (is_headline) {
    on_headline(robot, state);
  } else if (robot.change) {
    robot.change->state = state;
  }
  if (!is_watched(robot)) return;
  gather(robot, batch);
  if (is_headline) publish_gathered(robot);
}

void LiveFeed::gather(Robot& robot, const station::SampleBatch& batch) {
  if (robot.gathered && continues(*robot.gathered, batch)) {
    auto& samples = robot.gathered->samples;
    samples.insert(samples.end(), batch.samples.begin(), batch.samples.end());
  } else {
    publish_gathered(robot);
    robot.gathered = batch;
    robot.gathered_since_us = clock_.steady_us();
  }
  if (length_us(*robot.gathered) >= kGatheredUs) publish_gathered(robot);
}

void LiveFeed::publish_gathered(Robot& robot) {
  if (!robot.gathered) return;
  Message message{[&] { return samples_message(*robot.gathered); }};
  message.push(watch_all_, true);
  message.push(robot.watchers, true);
  robot.gathered.reset();
}

// Those of robots that have said no more for as long as gathering takes.
void LiveFeed::publish_late_samples() {
  const std::int64_t now_us = clock_.steady_us();
  for (auto& [id, robot] : robots_) {
    if (robot.gathered && now_us - robot.gathered_since_us >= kGatheredUs) publish_gathered(robot);
  }
}

void LiveFeed::on_event(const station::RobotState&, const station::RobotEvent& event) {
  Message{[&] { return dump({{"type", "event"}, {"event", to_json(event)}}); }}.push(watch_all_, false);
  if (filtered_.empty()) return;
  events_.push_back(event);
  if (events_.size() == kMaxLog) publish_log();
}

// A renewal is news only when it is refused: once, until one succeeds again.
bool LiveFeed::is_news(const station::CommandRecord& record) {
  if (record.kind != "renew_lease") return true;
  std::string& refusal = robots_[record.robot_id].renewal_refusal;
  if (was_accepted(record.state)) refusal.clear();
  const bool is_refused =
      record.state == station::CommandState::rejected || record.state == station::CommandState::expired ||
      record.state == station::CommandState::failed || record.state == station::CommandState::unknown;
  return is_refused && std::exchange(refusal, record.reason) != record.reason;
}

void LiveFeed::on_command(const station::CommandRecord& record) {
  if (!has_subscribers() || !is_news(record)) return;
  Message{[&] { return dump({{"type", "command"}, {"command", to_json(record)}}); }}.push(watch_all_, false);
  if (filtered_.empty()) return;
  std::erase_if(commands_, [&](const station::CommandRecord& older) { return older.id == record.id; });
  commands_.push_back(record);
  if (commands_.size() == kMaxLog) publish_log();
}

bool LiveFeed::watches(const station::RobotId& id) const {
  const auto robot = robots_.find(id);
  return !watch_all_.empty() || (robot != robots_.end() && !robot->second.watchers.empty());
}

void LiveFeed::publish_log() {
  if (events_.empty() && commands_.empty()) return;
  Message log{[&] { return dump({{"type", "log"}, {"events", list(events_)}, {"commands", list(commands_)}}); }};
  log.push(std::views::keys(filtered_), false);
  events_.clear();
  commands_.clear();
}

}  // namespace server::live
