// The keys of the world in a scenario.
#pragma once

#include "sim_robot/faults/fault.hpp"  // Fields, Range
#include "sim_robot/world/world.hpp"

namespace sim_robot {

constexpr Range kFlowRange{-0.01, 0.01};  // m³/s, as of the pump; 12 times what the paper's tubes are assumed to carry

void patch_fields(Fields& fields, GlucosePatch& patch);
// [fluid], [motor], [battery], [vessel], [vessel.pump], [glucose], [accelerometer], [electrode]
void world_fields(Fields& fields, WorldConfig& world);

}  // namespace sim_robot
