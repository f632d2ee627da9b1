// Paths, methods and queries.
#include "server/http/router.hpp"

#include <gtest/gtest.h>

#include "server/runtime/tasks.hpp"

namespace server {
namespace {

http::Answer echo(http::Request request) {
  http::Response response;
  response.body = request.method + " " + request.path;
  for (const auto& [name, value] : request.param) response.body += " " + name + "=" + value;
  for (const auto& [name, value] : request.query) response.body += " ?" + name + "=" + value;
  co_return response;
}

class RouterTest : public ::testing::Test {
 protected:
  RouterTest() {
    router_.add({"GET", "/api/v1/runs", identity::Scope::anyone, {"limit", "after"}, echo});
    router_.add({"POST", "/api/v1/runs", identity::Scope::anyone, {}, echo});
    router_.add({"GET", "/api/v1/runs/{run_id}/samples.csv", identity::Scope::anyone, {}, echo});
    router_.add({"GET", "/healthz", identity::Scope::anyone, {}, echo});
    router_.set_fallback([](const http::Request& request) {
      http::Response response;
      response.body = "page " + request.path;
      return response;
    });
  }

  http::Response get(const std::string& target, const std::string& method = "GET") {
    http::Request request;
    request.method = method;
    request.target = target;
    return runtime::run_first(loop_, run(std::move(request)));
  }
  int status(const std::string& target, const std::string& method = "GET") { return get(target, method).status; }

 private:
  // run_first wants a result that can be made before it is known.
  boost::asio::awaitable<http::Response> run(http::Request request) {
    co_return co_await router_.dispatch(std::move(request));
  }

  boost::asio::io_context loop_;
  http::Router router_;
};

TEST_F(RouterTest, FindsByMethodAndPathAndDecodesParameters) {
  EXPECT_EQ(get("/api/v1/runs").body, "GET /api/v1/runs");
  EXPECT_EQ(get("/api/v1/runs", "POST").body, "POST /api/v1/runs");
  EXPECT_EQ(get("/api/v1/runs/%37/samples.csv").body, "GET /api/v1/runs/7/samples.csv run_id=7");
  EXPECT_EQ(get("/api/v1/runs", "HEAD").status, 200);
}

TEST_F(RouterTest, ReadsKnownQueryParametersAndRefusesOthers) {
  EXPECT_EQ(get("/api/v1/runs?limit=5&after=a%2Fb+c").body, "GET /api/v1/runs ?after=a/b c ?limit=5");
  EXPECT_EQ(status("/api/v1/runs?page=2"), 400);
  EXPECT_EQ(status("/api/v1/runs?limit=1&limit=2"), 400);
  EXPECT_EQ(status("/api/v1/runs?limit=%zz"), 400);
  EXPECT_EQ(status("/api/v1/runs?limit=%0a"), 400);
}

TEST_F(RouterTest, OutsideTheApiAQueryChangesNothing) {
  for (const char* target : {"/healthz", "/healthz?x=1", "/healthz?x=1&x=2", "/healthz?%", "/%68ealthz?"}) {
    EXPECT_EQ(get(target).body, "GET /healthz") << target;
  }
}

TEST_F(RouterTest, AnswersUnknownPathsAndMethods) {
  EXPECT_EQ(status("/api/v1/nothing"), 404);
  EXPECT_EQ(status("/api/v1/runs/7"), 404);
  EXPECT_EQ(status("/api/v1/runs/"), 404);
  EXPECT_EQ(status("/api/v1/runs//samples.csv"), 404);
  const http::Response refused = get("/api/v1/runs", "DELETE");
  EXPECT_EQ(refused.status, 405);
  ASSERT_EQ(refused.headers.back().first, "Allow");
  EXPECT_EQ(refused.headers.back().second, "GET, HEAD, POST");
}

TEST_F(RouterTest, RefusesPathsThatHideSomething) {
  for (const char* target : {"/api/v1/../v1/runs", "/..", "/a/%2e%2e/b", "/a%2fb", "/a%5cb", "/a%00", "/%", "/%4",
                             "api/v1/runs", "", "ftp://host/api/v1/runs", "http://user@host/api/v1/runs", "*"}) {
    EXPECT_EQ(status(target), 400) << target;
  }
}

TEST_F(RouterTest, LeavesTheRestToTheFallback) {
  EXPECT_EQ(get("/").body, "page /");
  EXPECT_EQ(get("/assets/a.js?x=1").body, "page /assets/a.js");
}

}  // namespace
}  // namespace server
