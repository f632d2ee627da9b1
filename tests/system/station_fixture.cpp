// Wires the station for tests as main.cpp wires it for people.
#include "tests/system/station_fixture.hpp"

#include <unistd.h>

namespace server {

SystemTest::SystemTest() {
  std::string name = (std::filesystem::temp_directory_path() / "rheonaut-system-XXXXXX").string();
  folder = mkdtemp(name.data());
  clock.add_worker(disk);
  clock.add_worker(readers);
  clock.add_worker(exports);
  clock.add_worker(checkpoints);
  recording = std::make_unique<storage::RecordingParts>(loop, clock, disk, readers, exports, checkpoints,
                                                        storage::RecorderOptions{folder / "station.sqlite", {}});
  clock.add_worker(recording->backups.checker());
  recorder = &recording->recorder;
  runs = &recording->runs;
  history = &recording->history;
  recording->connect(station);
  station.add_sink(listener_of_events);
  runtime::run_first(loop, recording->open());
  recording->spawn(tasks);
  models = std::make_unique<station::ModelSender>(loop, tasks, clock, station, recording->fluid_models.in_force());
  const boost::asio::ip::tcp::endpoint any_port{boost::asio::ip::address_v4::loopback(), 0};
  listener = std::make_unique<link::RobotListener>(loop, clock, tasks, station, *recorder, any_port, false, entrance);
}

SystemTest::~SystemTest() {
  tasks.stop();
  clock.settle();
  recording->close();
  std::filesystem::remove_all(folder);
}

void SystemTest::begin(sim_robot::SimulatedRobotConfig config) {
  robot = std::make_unique<VirtualRobot>(loop, clock, tasks, std::move(config));
  robot->dial(*listener);
  ASSERT_TRUE(clock.run_until([this] { return station.find("sim-1") != nullptr && state().sample; }, 2s));
}

std::uint64_t SystemTest::give(const protocol::Command& command) {
  tasks.spawn("test commands", submit(++commands_given_, command));
  return commands_given_;
}

boost::asio::awaitable<void> SystemTest::submit(std::uint64_t id, protocol::Command action) {
  const bool is_stop = action.which_action == rheonaut_Command_emergency_stop_tag;
  station::CommandRequest request;
  request.robot_id = "sim-1";
  request.action = action;
  request.actor = "test";
  auto answered = is_stop ? station.emergency_stop({"sim-1", "test", "", "", 0}, 1s) : station.submit(request);
  const Result<station::CommandRecord> result = co_await std::move(answered);
  if (!result) {
    answers_[id].text = result.error().reason;
    co_return;
  }
  const bool is_done = was_accepted(result->state);
  const std::string otherwise = result->reason.empty() ? text(result->state) : result->reason;
  answers_[id] = {is_done ? "accepted" : otherwise, result->emergency_id, result->effect_at_robot_us};
}

std::optional<sim_robot::Answer> SystemTest::answer_to(std::uint64_t command_id) const {
  const auto found = answers_.find(command_id);
  if (found == answers_.end()) return std::nullopt;
  return found->second;
}

void SystemTest::Listener::on_robot(const station::RobotState& state) {
  if (state.link != station::LinkState::connected || state.connected_at_us == connected_at_us_) return;
  connected_at_us_ = state.connected_at_us;
  ++connections;
}

void SystemTest::Listener::on_event(const station::RobotState&, const station::RobotEvent& event) {
  const bool is_of_the_station = !event.event_seq.has_value();
  if (is_of_the_station || !known_events_.insert({event.boot_id, *event.event_seq}).second) return;
  test_.receive({event.kind, event.cause, 1e-6 * static_cast<double>(event.robot_time_us),
                 static_cast<double>(event.position_m), static_cast<double>(event.value), event.emergency_id});
}

sim_robot::Moment SystemTest::moment() const {
  return {1e-6 * static_cast<double>(clock.steady_us()), received(), sim_robot::true_view(robot->simulated()),
          listener_of_events.connections, state().next_seq - state().durable_next_seq};
}

sim_robot::View SystemTest::received() const {
  const station::RobotState& known = state();
  sim_robot::View view;
  view.link = known.link == station::LinkState::connected ? sim_robot::LinkView::up : sim_robot::LinkView::lost;
  view.mode = known.context.mode;
  view.emergency_id = known.context.emergency_id;
  view.sub_state = known.context.sub_state;
  if (known.context.setpoint_m) view.setpoint_m = static_cast<double>(*known.context.setpoint_m);
  view.flags = known.context.flags;
  const station::Sample newest = known.sample.value_or(station::Sample{});
  view.position_m = static_cast<double>(newest.position_m);
  view.velocity_m_s = static_cast<double>(newest.velocity_m_s);
  view.duty = static_cast<double>(newest.duty);
  view.impedance_mv = static_cast<double>(newest.impedance_mv);
  return view;
}

storage::RunId SystemTest::begin_run() {
  storage::RunConditions conditions;
  conditions.name = "a run of the test";
  return wait_for(runs->create("sim-1", conditions)).value().id;
}

std::vector<storage::StoredSample> SystemTest::samples_of(storage::RunId run) {
  std::vector<storage::StoredSample> samples;
  std::optional<storage::SampleCursor> after;
  do {
    const auto page = wait_for(history->samples(run, after, 1000));
    EXPECT_TRUE(page.has_value());
    samples.insert(samples.end(), page->samples.begin(), page->samples.end());
    after = page->next;
  } while (after);
  return samples;
}

void SystemTest::expect_whole(storage::RunId id) {
  const auto run = wait_for(runs->end(id, ""));
  ASSERT_TRUE(run.has_value());
  EXPECT_GT(run->samples_expected, 0u);
  EXPECT_EQ(run->samples_lost, 0u);
  EXPECT_EQ(run->samples_stored, run->samples_expected);
  const auto samples = samples_of(id);
  ASSERT_EQ(samples.size(), run->samples_expected);
  for (std::size_t i = 1; i < samples.size(); ++i) ASSERT_EQ(samples[i].seq, samples[i - 1].seq + 1);
}

}  // namespace server
