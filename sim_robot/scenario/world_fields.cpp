// Names every number of the world; what they mean is in the headers of its parts.
#include "sim_robot/scenario/world_fields.hpp"

#include <array>

#include "sim_robot/world/tick.hpp"

namespace sim_robot {
namespace {

constexpr std::array<const char*, 4> kFluids{"non_newtonian", "water", "water_nonlinear", "shear_thinning"};
constexpr std::array<const char*, 2> kBatteries{"steady", "cr123a"};
constexpr std::array<const char*, 2> kAccelerometers{"bno055", "perfect"};
constexpr std::array<const char*, 2> kPumpKinds{"pulse_70_bpm", "constant"};
constexpr std::array<const char*, 2> kElectrodes{"perfect", "ds550"};

constexpr Range kNotNegative{0, 1e9};
constexpr Range kRemovalTimes{0, kForEver};

void fluid_fields(Fields& fields, PlantParameters& plant) {
  std::size_t index = 0;
  fields.choice("preset", index, kFluids, "(29), (28), the nonlinear model of Section 3.1, or drag as speed^0.6");
  plant = fluid(kFluids[index]);
  if (plant.kind == PlantKind::linear) {
    control::FractionalModel& model = plant.model;
    fields.number("kp", model.kp, {-1e6, 1e6},
                  "gain, m/s per duty times b3; this and the next in place of the preset's");
    fields.number("b1", model.b1, kNotNegative, "of s^alpha");
    fields.number("b2", model.b2, kNotNegative, "of s^beta");
    fields.number("b3", model.b3, kNotNegative, "");
    fields.number("alpha", model.alpha, {0, 2}, "order, above beta");
    fields.number("beta", model.beta, {0, 2}, "order");
  }
  fields.number("dead_time_s", plant.dead_time_s, {0, 10}, "from the duty to its first effect");
  fields.must([&plant] {
    check(plant);
    const Plant made{plant, kTickS};  // not every model has a modal form
  });
}

void motor_fields(Fields& fields, MotorParameters& motor) {
  fields.number("dead_zone_duty", motor.dead_zone_duty, {0, 1}, "below it the motor stands still");
  fields.number("time_constant_s", motor.time_constant_s, {0, 10}, "a lag beyond the 22 ms of the models");
  fields.flag("is_reversed", motor.is_reversed, "its wires are swapped: a positive duty drives backwards");
  fields.must([&motor] { check(motor); });
}

void battery_fields(Fields& fields, BatteryParameters& battery) {
  std::size_t index = 0;
  fields.choice("preset", index, kBatteries, "steady: never sags; cr123a: falls with use and sags under load");
  if (index == 1) battery = kCr123a;
  fields.number("open_circuit_mv", battery.open_circuit_mv, {1, 1e5}, "when the robot boots");
  fields.number("nominal_mv", battery.nominal_mv, {1, 1e5}, "at which the fluid's model holds");
  fields.number("sag_mv", battery.sag_mv, {0, 1e5}, "at duty 1");
  fields.number("idle_discharge_mv_h", battery.idle_discharge_mv_h, {0, 1e7}, "with the motor off");
  fields.number("motor_discharge_mv_h", battery.motor_discharge_mv_h, {0, 1e7}, "more, at duty 1");
  fields.must([&battery] { check(battery); });
}

void pump_fields(Fields& fields, PumpParameters& pump) {
  auto kind = static_cast<std::size_t>(pump.kind);
  fields.choice("kind", kind, kPumpKinds, "constant: without pulsation");
  pump.kind = static_cast<PumpKind>(kind);
  fields.number("mean_flow_m3_s", pump.mean_flow_m3_s, kFlowRange, "negative: backwards");
  fields.number("starts_at_s", pump.starts_at_s, {-1e9, 1e9}, "time of the run; before 0 it has been on for long");
  fields.number("ramp_s", pump.ramp_s, {0, 1e6}, "of each change of the mean flow");
  fields.number("compliance_s", pump.compliance_s, {0, 10}, "of the walls; 0: rigid");
  fields.must([&pump] { check(pump); });
}

void vessel_fields(Fields& fields, VesselParameters& vessel) {
  fields.number("large_diameter_m", vessel.large_diameter_m, {0.001, 10}, "");
  fields.number("small_diameter_m", vessel.small_diameter_m, {0.001, 10}, "");
  fields.number("large_length_m", vessel.large_length_m, {0.001, 1000}, "");
  fields.number("small_length_m", vessel.small_length_m, {0.001, 1000}, "");
  fields.number("reservoir_diameter_m", vessel.reservoir_diameter_m, {0.001, 10}, "");
  fields.number("reservoir_length_m", vessel.reservoir_length_m, {0.001, 1000}, "");
  fields.number("junction_m", vessel.junction_m, {-1000, 1000}, "where the tubes meet, from where the robot boots");
  fields.flag("is_large_tube_first", vessel.is_large_tube_first, "forwards is from the large tube into the small one");
  fields.number("body_length_m", vessel.body_length_m, {0.001, 10}, "of the robot");
  fields.table("pump", "", [&vessel](Fields& inside) { pump_fields(inside, vessel.pump); });
  fields.must([&vessel] { check(vessel); });
}

void glucose_fields(Fields& fields, GlucoseParameters& glucose) {
  fields.number("nominal_mv", glucose.nominal_mv, {0, 5000}, "the impedance without glucose");
  fields.number("glucose_mv", glucose.glucose_mv, {0, 5000}, "at concentration 1");
  const auto patch_inside = [&glucose](Fields& inside) {
    GlucosePatch patch{.position_m = kMustBeGiven};
    patch_fields(inside, patch);
    inside.number("poured_at_s", patch.poured_at_s, {0, 1e9}, "time of the run");
    inside.number("removed_at_s", patch.removed_at_s, kRemovalTimes, "time of the run");
    inside.must([&patch] { check(patch); });
    glucose.patches.push_back(patch);
  };
  fields.tables("patches", "", patch_inside);
  fields.must([&glucose] { check(glucose); });
}

void accelerometer_fields(Fields& fields, std::optional<ImuParameters>& imu) {
  std::size_t index = 0;
  fields.choice("preset", index, kAccelerometers, "perfect: the robot is told the truth");
  if (index == 1) return imu.reset();
  imu.emplace();
  fields.number("noise_m_s2_rthz", imu->noise_m_s2_rthz, {0, 1}, "noise density, per √Hz");
  fields.number("bandwidth_hz", imu->bandwidth_hz, {0.1, 1000}, "");
  fields.number("offset_m_s2", imu->offset_m_s2, {0, 10}, "the largest");
  fields.number("calibration_s", imu->calibration_s, {0.01, 3600}, "at rest");
  fields.number("wander_m_s2", imu->wander_m_s2, {0, 1}, "sd of the bias");
  fields.number("wander_time_s", imu->wander_time_s, {0.1, 1e6}, "of the bias");
  fields.number("drift_m_s3", imu->drift_m_s3, {0, 1}, "of the bias, either way");
  fields.number("clock_error", imu->clock_error, {0, 0.1}, "the largest, relative");
  fields.number("missed_read_probability", imu->missed_read_probability, {0, 1}, "of each read");
  fields.number("axis_cosine", imu->axis_cosine, {-1, 1},
                "of its axis to forwards: -1 turned round, 0 across the tube");
  fields.must([&imu] { check(*imu); });
}

void electrode_fields(Fields& fields, ElectrodeParameters& electrode) {
  std::size_t index = 0;
  fields.choice("preset", index, kElectrodes, "perfect: the fluid's impedance as it is");
  if (index == 1) electrode = kDs550;
  fields.number("noise_mv", electrode.noise_mv, {0, 5000}, "sd of a reading");
  fields.number("offset_mv", electrode.offset_mv, {-5000, 5000}, "");
  fields.number("drift_mv_s", electrode.drift_mv_s, {-1000, 1000}, "");
  fields.must([&electrode] { check(electrode); });
}

}  // namespace

void patch_fields(Fields& fields, GlucosePatch& patch) {
  fields.number("position_m", patch.position_m, {-1000, 1000}, "its middle");
  fields.number("length_m", patch.length_m, {0.0001, 1000}, "");
  fields.number("concentration", patch.concentration, {0, 1000}, "1 is the paper's mixture");
  fields.number("edge_m", patch.edge_m, {0, 1000}, "sd of the edges when poured; 0: sharp");
  fields.number("mixing_m2_s", patch.mixing_m2_s, {0, 1000}, "0: does not spread");
  fields.number("decay_s", patch.decay_s, {0.001, kForEver}, "fades by a factor e in this time");
}

void world_fields(Fields& fields, WorldConfig& world) {
  fields.table("fluid", "", [&world](Fields& inside) { fluid_fields(inside, world.plant); });
  fields.table("motor", "", [&world](Fields& inside) { motor_fields(inside, world.motor); });
  fields.table("battery", "", [&world](Fields& inside) { battery_fields(inside, world.battery); });
  const auto vessel_inside = [&world](Fields& inside) { vessel_fields(inside, world.vessel.emplace()); };
  fields.table("vessel", "", vessel_inside);
  fields.table("glucose", "", [&world](Fields& inside) { glucose_fields(inside, world.glucose); });
  world.imu.emplace();
  fields.table("accelerometer", "", [&world](Fields& inside) { accelerometer_fields(inside, world.imu); });
  fields.table("electrode", "", [&world](Fields& inside) { electrode_fields(inside, world.electrode); });
}

}  // namespace sim_robot
