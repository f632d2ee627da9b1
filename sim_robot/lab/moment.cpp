// Looks into a simulated robot.
#include "sim_robot/lab/moment.hpp"

#include "sim_robot/robot/simulated_robot.hpp"

namespace sim_robot {

View true_view(const SimulatedRobot& robot) {
  const World& world = robot.world();
  const robot_fw::Robot& core = robot.core();
  View view;
  view.is_truth = true;
  view.position_m = world.position_m();
  view.velocity_m_s = world.velocity_m_s();
  view.impedance_mv = world.impedance_mv();
  view.duty = robot.motor_duty();
  view.mode = core.mode();
  view.emergency_id = core.emergency_id();
  view.link = core.link_lost() ? LinkView::lost : core.link_up() ? LinkView::up : LinkView::none;
  return view;
}

}  // namespace sim_robot
