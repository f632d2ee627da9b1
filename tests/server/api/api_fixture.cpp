// Wires the station as main does, and pumps it while a client waits.
#include "tests/server/api/api_fixture.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fstream>

#include "server/analysis/analysis_service.hpp"
#include "server/api/api_server.hpp"
#include "server/experiments/runner/experiments.hpp"
#include "server/link/robot_listener.hpp"
#include "server/station/models/model_sender.hpp"

namespace server {
namespace asio = boost::asio;

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "rheonaut-api-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::runtime_error{"cannot make a folder " + name};
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() { std::filesystem::remove_all(path_); }

namespace {
asio::awaitable<void> start(storage::RecordingParts& recording, station::Station& station, bool& started) {
  const storage::RestoredState restored = co_await recording.open();
  station.restore(restored.robots, restored.pending_stops, restored.reservations);
  started = true;
}

storage::RecorderOptions in_folder(storage::RecorderOptions options, const std::filesystem::path& folder) {
  const std::filesystem::path own = folder / "station.sqlite";
  if (!options.path.empty()) std::filesystem::copy_file(options.path, own);
  options.path = own;
  return options;
}

}  // namespace

struct ApiTest::Parts {
  explicit Parts(ApiTest& test)
      : analysis{test.recording.history, test.maths},
        live{test.clock},
        security{test.clock, test.config},
        robots{test.loop,    test.clock,       test.tasks,
               test.station, test.recorder,    {asio::ip::address_v4::loopback(), 0},
               false,        security.robots()},
        experiments{
            {test.loop, test.clock, test.tasks, test.station}, test.recording, test.maths, test.config.experiments} {}

  std::unique_ptr<station::ModelSender> models;  // made when the recording has started, like the API
  analysis::AnalysisService analysis;
  live::LiveFeed live;
  net::TransportSecurity security;
  link::RobotListener robots;
  experiments::Experiments experiments;
  std::unique_ptr<api::ApiServer> api;
};

ApiTest::ApiTest(config::Config of_station, storage::RecorderOptions of_recorder)
    : config{std::move(of_station)},
      recording{loop, clock, disk, readers, exports, checkpoints, in_folder(std::move(of_recorder), folder.path())},
      parts_{std::make_unique<Parts>(*this)},
      live{parts_->live},
      security{parts_->security},
      robots{parts_->robots} {
  clock.add_worker(disk);
  clock.add_worker(readers);
  clock.add_worker(checkpoints);
  clock.add_worker(exports);
  clock.add_worker(maths);
  clock.add_worker(recording.backups.checker());
  clock.add_worker(recording.jobs.worker());
  recording.connect(station);
  station.add_sink(live);
  bool started = false;
  tasks.spawn("start", start(recording, station, started));
  EXPECT_TRUE(clock.run_until([&] { return started; }, 10s));
  parts_->models =
      std::make_unique<station::ModelSender>(loop, tasks, clock, station, recording.fluid_models.in_force());
  api::ApiOptions options;
  options.endpoint = {asio::ip::address_v4::loopback(), 0};
  options.data_dir = folder.path();
  options.hosts = {"station.lab"};
  options.version = "0.1.0";
  options.store_id = 0xfedcba9876543210;
  options.robots_address = "127.0.0.1:7070";
  options.security = &security;
  options.password_cost = kCheapPasswords;
  options.foxglove = config.foxglove;
  parts_->api = std::make_unique<api::ApiServer>(loop, tasks, clock, options, station, live, recording,
                                                 parts_->analysis, parts_->experiments);
  clock.add_worker(logins().worker());
  recording.spawn(tasks);
  tasks.spawn("live feed", live.run());
  tasks.spawn("api", parts_->api->run());
  tasks.spawn("experiments", parts_->experiments.run());
  clock.settle();
}

ApiTest::~ApiTest() {
  tasks.stop();
  clock.settle();
}

TestRobot& ApiTest::connect_robot() {
  robot = std::make_unique<TestRobot>(loop, clock, tasks, robots);
  robot->say_hello();
  EXPECT_TRUE(clock.run_until([&] { return !robot->welcomes().empty(); }, 1s));
  robot->keep_talking();
  clock.settle();
  return *robot;
}

std::uint16_t ApiTest::port() const { return parts_->api->port(); }

std::string ApiTest::login_url() { return parts_->api->login_url(); }

const http::Router& ApiTest::router() const { return parts_->api->router(); }

identity::Accounts& ApiTest::accounts() { return parts_->api->accounts(); }

const identity::Logins& ApiTest::logins() const { return parts_->api->logins(); }

asio::awaitable<void> ApiTest::answer(http::Request request, std::shared_ptr<std::optional<Answered>> into) {
  Answered answered;
  answered.method = request.method;
  const http::Route* route = router().find(request.method, request.target);
  if (route != nullptr) answered.pattern = route->pattern;
  answered.response = co_await router().dispatch(std::move(request));
  answered.status = answered.response.status;
  answered.body = answered.response.body;
  while (answered.response.stream != nullptr) {
    const auto piece = co_await answered.response.stream->next();
    if (!piece || !*piece) break;
    answered.body += **piece;
  }
  into->emplace(std::move(answered));
}

std::shared_ptr<std::optional<Answered>> ApiTest::begin(const std::string& method, const std::string& target,
                                                        const json& body, std::map<std::string, std::string> headers) {
  http::Request request;
  request.method = method;
  request.target = target;
  request.headers = std::move(headers);
  if (!body.is_null()) request.body = body.dump();
  request.actor = actor;
  request.peer = "127.0.0.1";
  request.caller = identity::Caller{actor, "", scopes, session, standing, "127.0.0.1", client};
  auto into = std::make_shared<std::optional<Answered>>();
  tasks.spawn("ask", answer(std::move(request), into));
  clock.settle();
  return into;
}

Answered ApiTest::end(const std::shared_ptr<std::optional<Answered>>& asked, microseconds limit) {
  EXPECT_TRUE(clock.run_until([&] { return asked->has_value(); }, limit));
  if (!asked->has_value()) return {};
  if (check_answer != nullptr && !(*asked)->pattern.empty()) check_answer(**asked);
  return std::move(**asked);
}

Answered ApiTest::ask(const std::string& method, const std::string& target, const json& body) {
  return end(begin(method, target, body));
}

void ApiTest::make_samples(TestRobot& from, std::uint64_t first_seq, pb_size_t count) {
  from.send_samples(first_seq, count, from.robot_now_us(), 0);
  clock.settle();
}

std::optional<std::int64_t> ApiTest::seen_us(std::int64_t experiment) const {
  const experiments::Life* life = parts_->experiments.life_of(experiment);
  return life == nullptr ? std::nullopt : life->seen_us;
}

std::string ApiTest::token() const {
  std::ifstream in{folder.path() / "rheonaut.token"};
  std::string token;
  std::getline(in, token);
  return token;
}

RawClient::RawClient(VirtualClock& clock, std::uint16_t port, const char* from) : clock_{clock} {
  socket_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  ::inet_pton(AF_INET, from, &address.sin_addr);
  if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw std::runtime_error{"cannot come from that address"};
  }
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw std::runtime_error{"cannot connect"};
  }
  ::fcntl(socket_, F_SETFL, O_NONBLOCK);
  const int at_once = 1;  // as clients do: what is sent second does not wait for the answer to the first
  ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
  clock_.settle();
}

RawClient::~RawClient() { ::close(socket_); }

bool RawClient::pump() {
  clock_.settle();
  if (!reads) return true;
  pollfd readable{socket_, POLLIN, 0};
  ::poll(&readable, 1, 1);
  for (;;) {
    char bytes[16384];
    const ssize_t size = ::recv(socket_, bytes, sizeof bytes, 0);
    if (size > 0) {
      received_.append(bytes, static_cast<std::size_t>(size));
      continue;
    }
    if (size == 0 || (errno != EAGAIN && errno != EWOULDBLOCK)) ended_ = true;
    return !ended_;
  }
}

bool RawClient::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t size = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (size > 0) {
      bytes.remove_prefix(static_cast<std::size_t>(size));
      continue;
    }
    if (errno != EAGAIN && errno != EWOULDBLOCK) return false;
    pump();
  }
  if (!is_held) pump();
  return true;
}

std::string RawClient::read_until(const std::string& mark) {
  constexpr int kPatience = 2000;  // times 1 ms of real time
  for (int i = 0; i < kPatience && received_.find(mark) == std::string::npos && pump(); ++i) continue;
  const auto found = received_.find(mark);
  const auto end = found == std::string::npos ? received_.size() : found + mark.size();
  const std::string text = received_.substr(0, end);
  received_.erase(0, end);
  return text;
}

std::string RawClient::read_to_end() {
  constexpr int kPatience = 2000;
  for (int i = 0; i < kPatience && pump(); ++i) continue;
  return std::exchange(received_, {});
}

std::string RawClient::read_exactly(std::size_t count) {
  constexpr int kPatience = 2000;
  for (int i = 0; i < kPatience && received_.size() < count && pump(); ++i) continue;
  const std::string text = received_.substr(0, count);
  received_.erase(0, count);
  return text;
}

bool RawClient::closed() {
  pump();
  return ended_ && received_.empty();
}

}  // namespace server
