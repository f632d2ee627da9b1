// Jobs on a worker's thread whose caller is cancelled before their turn: left out where only the caller needs them.
#include "server/runtime/worker.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <future>
#include <string>
#include <vector>

#include "server/runtime/tasks.hpp"

namespace server {
namespace {

namespace asio = boost::asio;
using ::testing::ElementsAre;

// Its thread is held up until let_go().
class WorkerTest : public ::testing::Test {
 protected:
  WorkerTest() {
    auto hold = [until = go_.get_future().share()] { until.wait(); };
    spawn("hold", worker.run(std::move(hold)));
  }
  void spawn(const std::string& name, asio::awaitable<void> work) {
    tasks.spawn(name, std::move(work));
    loop.restart();
    loop.poll();
  }
  auto job(std::string name) {
    return [this, name = std::move(name)] { ran.push_back(name); };
  }
  void let_go() {
    go_.set_value();
    loop.restart();
    loop.run();
  }

  asio::io_context loop;
  runtime::WorkerThread worker{"test"};
  runtime::TaskGroup tasks{loop};
  std::vector<std::string> ran;  // on the worker's thread; read after let_go()

 private:
  std::promise<void> go_;
};

TEST_F(WorkerTest, WhatOnlyACancelledCallerNeedsIsLeftOut) {
  spawn("question", worker.run_unless_cancelled(job("question")));
  spawn("write", worker.run(job("write")));
  EXPECT_EQ(worker.jobs(), 3);
  tasks.stop();
  loop.restart();
  loop.poll();  // the cancellation is on its way
  let_go();
  EXPECT_THAT(ran, ElementsAre("write"));
  EXPECT_EQ(worker.jobs(), 0);
}

TEST_F(WorkerTest, EverythingElseIsRunInItsOrder) {
  spawn("question", worker.run_unless_cancelled(job("question")));
  spawn("write", worker.run(job("write")));
  let_go();
  EXPECT_THAT(ran, ElementsAre("question", "write"));
}

}  // namespace
}  // namespace server
