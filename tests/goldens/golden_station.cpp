// The fixture of the API, with pages that read all the time.
#include "tests/goldens/golden_station.hpp"

#include "tests/goldens/fixed_random.hpp"

namespace server {
namespace asio = boost::asio;

namespace {

constexpr const char* kConfig = "[limits]\nduty_max = 0.9\n[limits.water]\nduty_max = 0.5\n[fluids.oil]\n";

// So few that a burst of samples finds no room.
storage::RecorderOptions recorder_options(const std::filesystem::path& database) {
  storage::RecorderOptions options;
  options.path = database;
  options.max_queued_samples = 70;
  return options;
}

config::Config config_of(const char* text) {
  fix_random_bytes();  // before anything of the station is made
  return config::parse_config(text, "goldens.toml");
}

asio::awaitable<void> read_whole(live::RobotDocument document, std::string& into) {
  while (!document.is_whole()) into += co_await document.next();
}

}  // namespace

GoldenStation::GoldenStation(const std::filesystem::path& database)
    : ApiTest{config_of(kConfig), recorder_options(database)} {
  recording.disk_watch.set_free_bytes([](const std::filesystem::path&) { return std::uint64_t{50'000'000'000}; });
  live.add(all_);
  live.add(watcher_);
  live.watch(watcher_, {});
}

GoldenStation::~GoldenStation() {
  finish();
  live.remove(all_);
  live.remove(watcher_);
}

TestRobot& GoldenStation::dial(const protocol::RobotFrame& hello, microseconds booted_ago) {
  robots_.push_back(std::make_unique<TestRobot>(loop, clock, tasks, robots));
  TestRobot& made = *robots_.back();
  made.booted_at_us = clock.steady_us() - booted_ago.count();
  made.send(hello);
  EXPECT_TRUE(clock.run_until([&] { return !made.welcomes().empty(); }, 1s));
  made.keep_talking();
  pass(0s);
  return made;
}

void GoldenStation::pass(microseconds duration) {
  for (; duration > 100ms; duration -= 100ms) {
    clock.run_for(100ms);
    read_pages();
  }
  clock.run_for(duration);
  clock.settle();
  read_pages();
}

Answered GoldenStation::command(TestRobot& to, const std::string& path, const json& body, const Reply& reply) {
  const std::size_t before = to.commands().size();
  const auto asked = begin("POST", path, body);
  EXPECT_TRUE(clock.run_until([&] { return to.commands().size() > before || asked->has_value(); }, 1s)) << path;
  if (to.commands().size() > before) reply(to.commands().back());
  Answered answered = end(asked, 30s);
  read_pages();
  return answered;
}

std::string GoldenStation::welcome() {
  std::string text;
  identity::Caller ada;
  ada.actor = "user:ada";
  tasks.spawn("welcome", read_whole(welcome_message(ada, parts_), text));
  clock.settle();
  return text;
}

std::string GoldenStation::problem_of(const std::string& message) {
  const identity::Caller caller{
      "user:ada", "", identity::Scopes::of(identity::Role::admin), 0, std::make_shared<identity::Standing>(loop),
      "127.0.0.1"};
  const auto understood = on_page_message(message, caller, all_, parts_);
  return understood ? "" : api::problem_message(understood.error(), api::scope_needed_by(message));
}

std::string GoldenStation::dropped_message() {
  live::Subscriber slow{loop};
  const auto sample = std::make_shared<const std::string>();
  for (std::size_t i = 0; i < live::Subscriber::kMaxMessages + 3; ++i) slow.push(sample, true);
  return *slow.pop();
}

void GoldenStation::send(TestRobot& from, const protocol::RobotFrame& frame, microseconds then) {
  from.send(frame);
  pass(then);
}

void GoldenStation::read_pages() {
  read_page(all_, heard_by_all_);
  read_page(watcher_, heard_by_watcher_);
}

void GoldenStation::read_page(live::Subscriber& page, std::string& into) const {
  for (live::LiveText text = page.pop(); text != nullptr; text = page.pop()) {
    if (is_kept) into += *text + "\n";
  }
}

void GoldenStation::finish() {
  if (std::exchange(is_finished_, true)) return;
  tasks.stop();
  clock.settle();
  recording.close();
}

}  // namespace server
