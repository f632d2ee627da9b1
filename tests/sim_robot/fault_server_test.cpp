// The HTTP control over real sockets: faults in, what is in force out, and everything that is refused.
#include "sim_robot/client/fault_server.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <nlohmann/json.hpp>

#include "sim_robot/lab/impaired_link.hpp"

namespace sim_robot {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using Json = nlohmann::json;

constexpr auto kNoThrow = asio::as_tuple(asio::use_awaitable);

// Sends a text and reads until the server closes.
asio::awaitable<std::string> exchange(tcp::endpoint server, std::string request) {
  tcp::socket socket{co_await asio::this_coro::executor};
  co_await socket.async_connect(server, asio::use_awaitable);
  co_await asio::async_write(socket, asio::buffer(request), kNoThrow);
  std::string answer;
  co_await asio::async_read(socket, asio::dynamic_buffer(answer), kNoThrow);
  co_return answer;
}

class FaultServerTest : public ::testing::Test {
 protected:
  // `time` is how long a request may take: by default longer than a machine stalls.
  explicit FaultServerTest(bool has_network = false, std::chrono::milliseconds time = std::chrono::minutes{2})
      : has_network_(has_network), time_(time) {
    asio::co_spawn(loop_, server_.run(), asio::bind_cancellation_slot(stop_.slot(), [](std::exception_ptr) {}));
  }
  ~FaultServerTest() override {
    stop_.emit(asio::cancellation_type::terminal);
    loop_.restart();
    loop_.run();
  }

  std::string ask(const std::string& request) {
    std::string answer;
    bool has_answer = false;
    asio::co_spawn(loop_, exchange(server_.address(), request), [&](std::exception_ptr error, std::string text) {
      EXPECT_FALSE(error);
      answer = std::move(text);
      has_answer = true;
    });
    loop_.restart();
    while (!has_answer && loop_.run_one() > 0) {
    }
    return answer;
  }
  std::string post(const std::string& body, const std::string& headers = "Content-Type: application/json\r\n") {
    return ask("POST /faults HTTP/1.1\r\nHost: 127.0.0.1\r\n" + headers +
               "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body);
  }
  std::string request(const std::string& method, const std::string& target, const std::string& headers = "") {
    return ask(method + " " + target + " HTTP/1.1\r\nHost: localhost:80\r\n" + headers + "\r\n");
  }
  static Json body_of(const std::string& answer) {
    return Json::parse(answer.substr(std::min(answer.size(), answer.find("\r\n\r\n") + 4)), nullptr, false);
  }
  double reading_mv() {
    SimulatedRobot& robot = life_.robot();
    return static_cast<double>(robot.world().read(robot.robot_time_us()).impedance_mv);
  }

  static SimulatedRobotConfig in_a_tube() {
    SimulatedRobotConfig config;
    config.world.imu.emplace();
    config.world.vessel.emplace();
    return config;
  }

  const bool has_network_;
  const std::chrono::milliseconds time_;
  asio::io_context loop_{1};
  asio::cancellation_signal stop_;
  RobotLife life_{has_network_ ? in_a_tube() : SimulatedRobotConfig{}};
  ImpairedLink network_{life_};
  FaultTimeline faults_;
  FaultServer server_{
      loop_, parse_faults_address("127.0.0.1:0"), faults_, {life_, has_network_ ? &network_ : nullptr}, time_};
};

class FaultServerWithANetwork : public FaultServerTest {
 protected:
  FaultServerWithANetwork() : FaultServerTest(true) {}
};

class ImpatientFaultServer : public FaultServerTest {
 protected:
  ImpatientFaultServer() : FaultServerTest(false, std::chrono::milliseconds{200}) {}
};

// What must be given, at the least that is allowed.
Json least_of(const Json& type) {
  Json fault{{"fault", type.at("fault")}};
  for (const Json& field : type.at("fields")) {
    if (field.at("must_be_given") == true) fault[std::string(field.at("key"))] = field.at("minimum");
  }
  return fault;
}

TEST_F(FaultServerWithANetwork, TakesEveryFaultThereIsAndEndsThoseThatLast) {
  network_.step();
  for (const Json& type : body_of(request("GET", "/faults")).at("known")) {
    EXPECT_EQ(type.at("is_in_this_run"), true) << type;
    EXPECT_THAT(post(least_of(type).dump()), StartsWith("HTTP/1.1 201 ")) << type;
    network_.step();
  }
  const Json in_force = body_of(request("GET", "/faults")).at("in_force");
  EXPECT_EQ(in_force.size(), 11u) << "one of each target that lasts: " << in_force;
  for (const Json& each : in_force) {
    EXPECT_THAT(request("DELETE", "/faults/" + each.at("id").dump()), StartsWith("HTTP/1.1 204 "));
  }
  EXPECT_TRUE(faults_.in_force().empty());
  EXPECT_EQ(network_.impairments().up.bytes_per_s, 0);
  while (!life_.is_on()) network_.step();
  EXPECT_FALSE(life_.is_blocked());
}

TEST_F(FaultServerWithANetwork, SaysHowOftenTheRobotHasBooted) {
  network_.step();
  EXPECT_EQ(body_of(request("GET", "/faults")).at("boots"), 1);
  EXPECT_THAT(post(R"({"fault":"reboot","off_for_s":0})"), StartsWith("HTTP/1.1 201 "));
  const Json shown = body_of(request("GET", "/faults"));
  EXPECT_EQ(shown.at("boots"), 2);
  EXPECT_EQ(shown.at("time_s"), 0.01);
  EXPECT_EQ(shown.at("robot_time_s"), 0);
  EXPECT_TRUE(shown.at("in_force").empty());
}

TEST_F(FaultServerTest, TakesAFaultShowsItAndEndsIt) {
  const std::string created = post(R"({"fault":"electrode_offset","offset_mv":40})");
  EXPECT_THAT(created, StartsWith("HTTP/1.1 201 "));
  EXPECT_EQ(reading_mv(), 215);
  const std::uint64_t id = body_of(created).at("id");
  const Json shown = body_of(request("GET", "/faults"));
  EXPECT_EQ(shown.at("robot_id"), "sim-1");
  ASSERT_EQ(shown.at("in_force").size(), 1u);
  EXPECT_EQ(shown.at("in_force")[0].at("fault"), "electrode_offset");
  EXPECT_EQ(shown.at("in_force")[0].at("offset_mv"), 40);
  EXPECT_EQ(shown.at("in_force")[0].at("until_s"), nullptr);
  EXPECT_THAT(request("DELETE", "/faults/" + std::to_string(id)), StartsWith("HTTP/1.1 204 "));
  EXPECT_EQ(reading_mv(), 175);
  EXPECT_THAT(request("DELETE", "/faults/" + std::to_string(id)), StartsWith("HTTP/1.1 404 "));
}

TEST_F(FaultServerTest, ListsWhatThereIs) {
  const Json known = body_of(request("GET", "/faults")).at("known");
  ASSERT_EQ(known.size(), fault_types().size());
  EXPECT_EQ(known[1].at("fault"), "accelerometer_noisy");
  EXPECT_EQ(known[1].at("fields")[0].at("key"), "sd_m_s2");
  EXPECT_EQ(known[1].at("fields")[0].at("must_be_given"), true);
  EXPECT_EQ(known[1].at("fields")[0].at("maximum"), 160);
}

TEST_F(FaultServerTest, RefusesWithAReasonAndWhatIsAllowed) {
  const std::string wrong = post(R"({"fault":"electrode_offset","offset_mv":9000})");
  EXPECT_THAT(wrong, StartsWith("HTTP/1.1 400 "));
  EXPECT_EQ(body_of(wrong).at("detail"), "offset_mv: is 9000, allowed is -5000 to 5000");
  EXPECT_EQ(body_of(wrong).at("reason"), "invalid_fault");
  EXPECT_THAT(post("{"), StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(post("\xff\xfe"), StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(post(R"({"fault":"link_reset"})"), StartsWith("HTTP/1.1 409 "));
  EXPECT_THAT(post(R"({"fault":"link_reset"})"), HasSubstr("has no network of its own"));
  EXPECT_THAT(post(R"({"fault":"mean_flow","mean_flow_m3_s":0})"), HasSubstr("there is no vessel"));
  EXPECT_THAT(post("{}", "Content-Type: text/plain\r\n"), StartsWith("HTTP/1.1 415 "));
  EXPECT_THAT(request("DELETE", "/faults/x"), StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(request("PUT", "/faults"), StartsWith("HTTP/1.1 405 "));
  EXPECT_THAT(request("GET", "/elsewhere"), StartsWith("HTTP/1.1 404 "));
  EXPECT_TRUE(faults_.in_force().empty());
}

TEST_F(FaultServerTest, RefusesPagesInABrowserAndOtherNames) {
  EXPECT_THAT(request("GET", "/faults", "Origin: http://evil.example\r\n"), StartsWith("HTTP/1.1 403 "));
  EXPECT_THAT(ask("GET /faults HTTP/1.1\r\nHost: evil.example\r\n\r\n"), StartsWith("HTTP/1.1 403 "));
  EXPECT_THAT(ask("GET /faults HTTP/1.1\r\nHost: [::1]:7400\r\n\r\n"), StartsWith("HTTP/1.1 200 "));
}

TEST_F(FaultServerTest, HoldsItsLimits) {
  EXPECT_THAT(post(std::string(20'000, ' ')), StartsWith("HTTP/1.1 413 "));
  EXPECT_THAT(request("GET", "/faults", "X: " + std::string(10'000, 'x') + "\r\n"), StartsWith("HTTP/1.1 431 "));
  EXPECT_THAT(ask("nonsense\r\n\r\n"), StartsWith("HTTP/1.1 400 "));
}

TEST_F(ImpatientFaultServer, ClosesAConnectionThatSaysNothingAndServesTheNext) {
  EXPECT_EQ(ask("GET /faults HT"), "");
  std::string answer;
  while (answer.empty()) answer = request("GET", "/faults");  // a stall of the machine may take all its time
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 "));
}

TEST(FaultsAddress, IsOfTheLoopbackUnlessForced) {
  EXPECT_EQ(parse_faults_address("localhost:80").address().to_string(), "127.0.0.1");
  EXPECT_EQ(parse_faults_address("[::1]:0").port(), 0);
  EXPECT_EQ(parse_faults_address("0.0.0.0:7400", true).port(), 7400);
  for (const char* wrong :
       {"0.0.0.0:7400", "127.0.0.1", "127.0.0.1:", "127.0.0.1:70000", "127.0.0.1:x", "example:1", ""}) {
    EXPECT_THROW(parse_faults_address(wrong), std::invalid_argument) << wrong;
  }
}

}  // namespace
}  // namespace sim_robot
