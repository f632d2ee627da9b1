// Estimates the robot's position: a Kalman filter on accelerometer readings, aided by a model driven by the duty.
//
//   v_m = Σ (g_i + δ_i) y_i,  y_i' = (u - y_i)/τ_i                 (1)   model: first-order sections, from (28) or (29)
//   p' = v,  v' = a - b                                            (2)   a = counts/100 m/s²; without a reading
//                                                                        v' = v_m'
//   0 = v - v_m - d + ε                                            (3)   a measurement in every fifth tick
//   p → position, v → velocity, b → bias (random walk), δ_i → error of a section's gain (constant), d → drift with a
//   pulsating flow (0 without one);  u → duty;  ε → `shape_error` · v_m, a lag times a, and a floor
//
// - The model's gain may be off by ±20 %: all δ_i alike (sd `gain_error` · g_i); it is known within a few percent
//   once the robot has moved. A measurement beyond 3 sd raises its variance again, so that the filter also finds the
//   gain of another fluid; that is a model_mismatch, as are lasting surprises.
// - A model that nobody has confirmed for this fluid may have another shape as well: each δ_i has an sd of its own,
//   `section_error` · Σ g. The sections span 0.03 s to 15 s, so driving finds most of another fluid's shape, and
//   position_sd_m includes the part that is still unknown. What four sections cannot follow of it in the first seconds
//   is ε's: a lag of 25 ms (sd), and 0.5 s for which an error of the shape keeps its sign (4 ms, the age of a reading,
//   and 0.1 s with a confirmed model). What is surprising is judged as with a confirmed one.
// - With the motor off and v_m died down, (3) has a smaller floor: the zero-velocity update.
// - Errors of (3) keep their sign for `correlation_s` and more. They are treated as white noise of the same area,
//   variance · 2 correlation / interval.
// - The sensor has its own clock: a repeated or skipped reading changes the velocity by up to a · 10 ms for good, which
//   is modelled as noise relative to each tick's change. 25 equal readings in a row count as missing.
// - Motion under a duty below `doubtful_duty`, where the motor may stand still, is summed and added to the
//   standard deviation. The filter itself does not change: more noise in (3) would let the estimate drift in a loop.
// - An unexplained pulsation of the velocity over 3 s counts as a flow, which carries the robot by an unknown mean: its
//   sd is 1.5 times the pulsation's rms, in v and d alike; δ starts again. With a model that nobody has confirmed, the
//   part of it that follows the model's own pulsation (as a gain off by `gain_error` would, or a lag of 25 ms) is the
//   model's error instead: ε is larger by as large a share of v_m, which keeps its sign for 4 s.
// Cannot see: a steady drift with the fluid. With the motor off, 1 mm/s for 40 s is 40 mm, outside any position_sd_m.
//             Nor a pulsating flow below 4 mm/s rms, 8 mm/s mean with the pump's profile.
// Accuracy: ≤ 5 mm at 95 % 42 s after moves of 0.1 m, within 2 position_sd_m in ≥ 90 % of trials; the table is in
//           docs/robot.md, held by estimator_study_test.cpp. In other fluids than its model's:
//           estimator_fluids_test.cpp.
// Cost:     580 bytes; in instructions of the chip: docs/robot.md.
// Errors:   a duty that is not finite counts as 0, a tick of a length outside (0, 0.1] s is ignored; if a state is
//           still not finite, or rounding spoils the covariance, it restarts: position_sd_m 10 m, any velocity.
// Differs from the paper: the algorithm that the paper names is not published; this one replaces it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "robot_fw/core/crc32.hpp"
#include "robot_fw/core/pulsation_watch.hpp"

namespace robot_fw {

constexpr std::size_t kModelSections = 4;
constexpr float kMS2PerCount = 0.01F;

// (1); unused sections have gain 0.
struct VelocityModel {
  std::array<float, kModelSections> gain_m_s{};         // g, per duty
  std::array<float, kModelSections> time_constant_s{};  // τ > 0
};

// (29) of the paper, fitted from 10 ms to 60 s: velocity within 0.2 % of the final one, position within 0.6 mm in 6 m.
constexpr VelocityModel kFluidVelocityModel{{-0.0812087F, 0.175233F, 0.00547444F, 0.000501103F},
                                            {0.0295594F, 0.0603861F, 0.715844F, 15.1143F}};
// (28) of the paper, exact.
constexpr VelocityModel kWaterVelocityModel{{0.513615F, -0.165841F, 0, 0}, {0.0681359F, 0.0220005F, 1, 1}};

// Standard deviations, unless noted.
struct EstimatorParameters {
  VelocityModel model = kFluidVelocityModel;
  float dead_zone_duty = 0;              // below it the motor stands still
  float doubtful_duty = 0.05F;           // below it the motor may stand still
  bool is_confirmed = false;             // the model is that of the fluid that the robot swims in
  float gain_error = 0.2F;               // of all gains alike, relative, at the start
  float section_error = 0.1F;            // of each single gain, relative to the steady gain, unless confirmed
  float shape_error = 0.05F;             // of the model's velocity, relative to it, whatever its gain
  float driven_velocity_m_s = 0.0004F;   // of the model's velocity, whatever it is
  float resting_velocity_m_s = 0.0001F;  // the same with the motor off
  float correlation_s = 0.5F;            // of these two; not an sd
  float noise_m_s2 = 0.013F;             // of a reading, quantisation included
  float bias_m_s2 = 0.003F;              // at the start
  float bias_walk_m_s2 = 0.0003F;        // of the bias's change in 1 s
};

struct EstimatorInputs {
  std::int16_t counts = 0;  // of the accelerometer, 100 per m/s²
  bool is_valid = false;    // false: no reading came in this tick
  float duty = 0;           // what the motor had since the last tick, in [-1, 1]
  float dt_s = 0;           // since the last tick
};

class Estimator {
 public:
  // Starts at position 0, at rest; pass `position_sd_m` when the robot may still be coasting.
  explicit Estimator(const EstimatorParameters& parameters, float position_sd_m = 0);

  void step(const EstimatorInputs& inputs);
  // Sets the position to 0, with variance 0.
  void zero_position();
  // From the next tick on; is_settled() must hold.
  void set_parameters(const EstimatorParameters& parameters);

  // The motor is off and the model's velocity has died down.
  bool at_rest() const;
  // As above, or the motor has been off and the accelerometer has read nothing for 5 s: any parameter may change then.
  bool is_settled() const { return at_rest() || still_s_ >= kSettledS; }

  float position_m() const { return position_m_; }
  float velocity_m_s() const { return velocity_m_s_; }
  float acceleration_m_s2() const { return acceleration_m_s2_; }  // the last reading, less the bias
  float position_sd_m() const { return position_sd_m_; }
  float bias_m_s2() const { return bias_m_s2_; }
  float model_gain() const { return 1 + gain_error(); }     // found, relative to the parameters'
  float flow_m_s() const { return pulsation_.flow_m_s(); }  // rms of a pulsating flow; 0: none seen
  // The model does not explain the motion: another fluid, or one that moves.
  bool model_mismatch() const { return mismatch_; }
  float surprise() const { return surprise_; }  // of the last measurement: innovation² by its variance

  void add_to(Crc32& crc) const;  // its state

 private:
  static constexpr float kSettledS = 5;
  static constexpr std::size_t kStates = 4 + kModelSections;
  enum State : std::size_t { position, velocity, bias, drift, gain };  // gain: the first section's
  using Vector = std::array<float, kStates>;

  // Since the last update of the covariance.
  struct Interval {
    int ticks = 0;
    float duration_s = 0;
    float sensed_s = 0;                            // of it with a reading
    std::array<float, kModelSections> modelled{};  // change of the sections in the rest of it
    float velocity_variance = 0;                   // (m/s)², that came in
    float fastest_change_m_s2 = 0;                 // of the velocity
  };

  void start();
  void tune_sections(float dt_s);
  void advance_model(float duty);
  float gain_error() const;     // of the model's steady gain, relative
  float gain_variance() const;  // of that
  void restart_gains();
  void reopen_gain(float relative_variance);
  void watch_stillness(float reading_m_s2, float dt_s);
  bool has_reading(const EstimatorInputs& inputs);
  void integrate(const EstimatorInputs& inputs);
  void propagate_covariance();
  void propagate_modelled();
  void let_drift_die_down();
  void admit_drift();
  float measurement_variance(bool is_confirmed) const;
  bool compare_with_model();  // false: the covariance is no longer valid
  void correct(const Vector& gains, const Vector& ph, float variance, float innovation);
  void watch_model(float surprise);
  void guard(bool sound);

  EstimatorParameters parameters_;
  std::array<float, kModelSections> section_share_{};   // share of its remaining way that a section goes in a tick
  std::array<float, kModelSections> section_{};         // of a section with gain 1
  std::array<float, kModelSections> section_change_{};  // of it, in this tick
  float tuned_dt_s_ = 0;
  float steady_gain_m_s_ = 0;  // of the model, per duty
  float duty_ = 0;
  float model_m_s_ = 0;   // v_m
  float still_s_ = 0;     // for so long the motor is off and nothing is felt
  float felt_m_s2_ = 0;   // the readings' mean over the last second, less the bias
  float doubtful_m_ = 0;  // travelled by the model under duties that are doubtful

  float position_m_ = 0, velocity_m_s_ = 0, bias_m_s2_ = 0, drift_m_s_ = 0;
  std::array<float, kModelSections> gain_change_m_s_{};  // found, from the parameters'
  std::array<Vector, kStates> covariance_{};
  float position_sd_m_ = 0;
  Interval interval_;

  float acceleration_m_s2_ = 0;
  std::int16_t last_counts_ = 0;
  int repeats_ = 0;

  PulsationWatch pulsation_;
  bool drift_admitted_ = false;
  float surprise_ = 0;
  float surprises_ = 0;    // the excess over the expected value, summed
  int strange_gains_ = 0;  // measurements in a row
  bool mismatch_ = false;
};

}  // namespace robot_fw
