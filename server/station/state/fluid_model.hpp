// The model of a fluid, which is sent to robots in it: the velocity of a robot as a sum of first-order sections.
//
//   v(s)/u(s) = Σ gain_m_s[i] / (1 + time_constant_s[i] s), i = 0 … 3   (robot_fw/core/estimator, docs/control.md)
//
// Plain values, and the list of the models in force. Loop thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

namespace server::station {

inline constexpr std::size_t kFluidModelSections = 4;

// The ranges of the robot's parameters (docs/robot.md).
inline constexpr float kMaxModelGain_m_s = 10;
inline constexpr float kMinModelTimeConstant_s = 0.001F;
inline constexpr float kMaxModelTimeConstant_s = 1000;
// Of the final velocity. SAFETY: with a model that fits worse a robot is surer of its position than it may be.
inline constexpr double kMaxModelFitError = 0.005;
// sd of each gain by itself, a share of their sum, of a model that is assumed only: at least that of a robot that
// does not know its fluid (docs/robot.md). SAFETY: a robot whose model is in doubt is as unsure as one without.
inline constexpr float kAssumedSectionError = 0.1F;

struct FluidModel {
  using Numbers = std::array<float, kFluidModelSections>;
  Numbers gain_m_s{};
  Numbers time_constant_s{};
  double fit_error = 0;  // a share of the final velocity, in [0, kMaxModelFitError]
  std::string
      assumed_because;  // the grave doubts about it, in words: robots are sent it as assumed; empty: as confirmed
  std::string document = "{}";  // what else came with it, as JSON: plant, name, comment, description
  std::string set_by;           // the actor
  std::int64_t set_at_us = 0;   // UTC
  bool is_confirmed() const { return assumed_because.empty(); }
  bool operator==(const FluidModel&) const = default;
};

// As the robot names them, in the order of its table.
std::array<std::pair<std::string, float>, 2 * kFluidModelSections> parameters_of(const FluidModel& model);

// The models in force, by fluid. The store of the models fills it.
class FluidModelList {
 public:
  // Null when the fluid has none; until the next change of the list.
  const FluidModel* find(const std::string& fluid) const {
    const auto found = models_.find(fluid);
    return found == models_.end() ? nullptr : &found->second;
  }
  const std::map<std::string, FluidModel>& all() const { return models_; }
  void put(const std::string& fluid, FluidModel model) { models_[fluid] = std::move(model); }
  void remove(const std::string& fluid) { models_.erase(fluid); }

 private:
  std::map<std::string, FluidModel> models_;
};

}  // namespace server::station
