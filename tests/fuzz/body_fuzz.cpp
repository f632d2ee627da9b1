// Feeds any body to every route that changes something, as an admin sends it to a whole station, and any text to /live:
// the answer is JSON, and never 500.
//
// The first line is a route's pattern, or /live; what is neither picks one of them by its first byte. The rest is the
// body.
#include <algorithm>
#include <cstdlib>

#include "server/api/live_messages.hpp"
#include "server/http/router.hpp"
#include "server/identity/accounts.hpp"
#include "server/live/live_feed.hpp"
#include "server/live/robot_texts.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

const std::string kLive = "/live";
constexpr int kChangesOfAStation = 300;  // then a new one is made: nothing it keeps grows for ever

void require(bool condition, const std::string& what) {
  if (condition) return;
  std::fprintf(stderr, "%s\n", what.c_str());
  std::abort();
}

// A station with a robot that is away, a user, a token and a session.
class BodyStation : public ApiTest {
 public:
  BodyStation() {
    station.restore({station::RestoredRobot{"r1"}}, {});
    ask("POST", "/api/v1/users", {{"name", "anna"}, {"role", "operator"}, {"password", "correct horse"}});
    ask("POST", "/api/v1/tokens", {{"name", "ci"}, {"scopes", "read"}});
    ask("POST", "/api/v1/runs", {{"robot_id", "r1"}, {"name", "first"}});
    accounts().open_session("anna", "", "");
    for (const http::Route& route : router().routes()) {
      if (route.method != "GET") patterns_.push_back(route.pattern);
    }
    patterns_.push_back(kLive);
    live.add(page_);
  }
  ~BodyStation() override { live.remove(page_); }

  bool is_used_up() const { return changes_ >= kChangesOfAStation; }

  void send(const std::string& choice, const std::string& body) {
    const auto named = std::ranges::find(patterns_, choice);
    const std::size_t by_byte = choice.empty() ? 0 : static_cast<unsigned char>(choice.front()) % patterns_.size();
    const std::string pattern = named != patterns_.end() ? *named : patterns_[by_byte];
    if (pattern == kLive) return say(body);
    std::optional<http::Response> response;
    tasks.spawn("ask", answer(request_of(target_of(pattern), body), response));
    require(clock.run_until([&] { return response.has_value(); }, 60s), "no answer of " + pattern);
    const std::string what = pattern + ": " + std::to_string(response->status) + " " + response->body;
    require(response->status >= 200 && response->status != 500, what);
    require(json::accept(response->body), what);
    if (response->status < 300) ++changes_;
  }

 private:
  void TestBody() override {}

  static std::string target_of(const std::string& pattern) {
    const std::map<std::string, std::string> values{
        {"robot_id", "r1"}, {"run_id", "1"},    {"job_id", "1"},        {"user", "anna"},       {"token", "ci"},
        {"session", "1"},   {"fluid", "water"}, {"experiment_id", "1"}, {"reservation_id", "1"}};
    std::string target;
    for (std::size_t i = 0; i < pattern.size(); ++i) {
      if (pattern[i] != '{') {
        target += pattern[i];
        continue;
      }
      const auto end = pattern.find('}', i);
      target += values.at(pattern.substr(i + 1, end - i - 1));
      i = end;
    }
    return target;
  }

  http::Request request_of(const std::string& target, const std::string& body) {
    http::Request request;
    request.method = "POST";
    request.target = target;
    request.body = body;
    request.actor = "token:local";
    request.peer = "127.0.0.1";
    request.caller = identity::Caller{
        "token:local", "", identity::Scopes::of(identity::Role::admin), 0, std::make_shared<identity::Standing>(loop),
        "127.0.0.1"};
    return request;
  }

  boost::asio::awaitable<void> answer(http::Request request, std::optional<http::Response>& into) {
    into = co_await router().dispatch(std::move(request));
  }

  void say(const std::string& text) {
    const identity::Caller caller{
        "token:local", "", identity::Scopes::of(identity::Role::admin), 0, std::make_shared<identity::Standing>(loop),
        "127.0.0.1"};
    const auto understood = on_page_message(text, caller, page_, live_parts_);
    if (!understood) require(json::accept(api::problem_message(understood.error(), api::scope_needed_by(text))), text);
    clock.settle();
    ++changes_;
  }

  live::Subscriber page_{loop};
  live::RobotTexts texts_{loop, station};
  api::LiveParts live_parts_{loop, tasks, clock, station, live, texts_, "0"};
  std::vector<std::string> patterns_;
  int changes_ = 0;
};

void send(const std::string& text) {
  static std::unique_ptr<BodyStation> station;
  if (station == nullptr || station->is_used_up()) {
    station.reset();
    station = std::make_unique<BodyStation>();
  }
  const auto end = std::min(text.find('\n'), text.size());
  station->send(text.substr(0, end), text.substr(std::min(end + 1, text.size())));
}

}  // namespace
}  // namespace server

int fuzz::body(const std::uint8_t* data, std::size_t size) {
  server::send({reinterpret_cast<const char*>(data), size});
  return 0;
}
