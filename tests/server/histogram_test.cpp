// Counts by upper bound, and how late the loop is.
#include "server/runtime/histogram.hpp"

#include "server/runtime/loop_lateness.hpp"
#include "server/runtime/tasks.hpp"
#include "tests/server/virtual_clock.hpp"

namespace server {
namespace {

using namespace std::chrono_literals;

TEST(Histogram, CountsUnderTheFirstBoundThatIsNotBelow) {
  runtime::DepthHistogram depths;
  for (const std::int64_t depth : {-3, 0, 10, 11, 1'000'000, 1'000'001}) depths.add(depth);
  EXPECT_EQ(depths.counts(), (std::array<std::uint64_t, 7>{3, 1, 0, 0, 0, 1, 1}));
  EXPECT_EQ(depths.sum(), 2'000'022);
}

TEST(LoopLateness, CountsFourTimesASecondWhatATimerIsLateBy) {
  boost::asio::io_context loop{1};
  VirtualClock clock{loop};
  runtime::TaskGroup tasks{loop};
  runtime::LoopLateness lateness;
  tasks.spawn("lateness", lateness.run(clock));
  clock.run_for(2s + 1ms);
  EXPECT_EQ(lateness.times().counts().front(), 8U);  // virtual time is never late
  EXPECT_EQ(lateness.times().sum(), 0);
  tasks.stop();
  clock.run_for(1s);
}

}  // namespace
}  // namespace server
