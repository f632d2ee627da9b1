// SAFETY: what waits for a robot after a stop of it, and after its reset.
#include "tests/system/experiment_fixture.hpp"

namespace server {
namespace {

using namespace server::experiments;

constexpr const char* kTenSeconds = "kind = \"duty\"\nduty = 0.2\nfor_s = 10";

class StopsAndQueueTest : public ExperimentTest {
 protected:
  StopsAndQueueTest() { begin(); }
};

// SAFETY: also the press that is answered by the stop that is kept already.
TEST_F(StopsAndQueueTest, EachPressHoldsWhatWaitsAlsoWhileAStopIsKept) {
  robot->redial = false;
  robot->cut();
  clock.run_for(2s);
  send(sim_robot::emergency_stop());
  clock.run_for(1s);
  const auto id = enqueue(profile({kTenSeconds}));
  clock.run_for(1s);
  EXPECT_EQ(view(id).waits_for, "robot_not_connected");
  send(sim_robot::emergency_stop());
  clock.run_for(1s);
  EXPECT_TRUE(view(id).experiment.is_held);
  const auto next = enqueue(profile({kTenSeconds}));
  ASSERT_FALSE(view(next).experiment.is_held);
  const auto stop_all = [this]() -> boost::asio::awaitable<void> {
    station::StopRequest request;
    request.actor = "boris";
    co_await station.stop_all(std::move(request), 1s);
  };
  tasks.spawn("a stop of all", stop_all());
  clock.run_for(2s);
  EXPECT_TRUE(view(next).experiment.is_held);
}

TEST_F(StopsAndQueueTest, NothingBeginsTheMomentThatSomebodyResetsTheEmergency) {
  come("anna");
  send(sim_robot::emergency_stop());
  clock.run_for(1s);
  const auto id = enqueue(profile({kTenSeconds}));
  ASSERT_TRUE(command_by("anna", sim_robot::clear_emergency(state().context.emergency_id)));
  clock.run_for(2s);
  EXPECT_EQ(view(id).waits_for, "robot_in_use");
  EXPECT_EQ(robot->simulated().motor_duty(), 0);
  until(id, ExperimentState::running);
}

}  // namespace
}  // namespace server
