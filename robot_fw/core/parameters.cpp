// The table of parameters.
#include "robot_fw/core/parameters.hpp"

#include <cmath>
#include <cstring>

#include "robot_fw/core/crc32.hpp"

namespace robot_fw {
namespace {

// In the order of ParameterId. The position limits always leave room around 0, and the defaults limit nothing that the
// paper's experiments do.
constexpr std::array<ParameterSpec, kParameterCount> kTable{{
    {"auto_limit_s", "s", 1, 3600, 600, false},
    {"setpoint_limit_m", "m", 0.01F, 100, 1, false},
    {"link_timeout_ms", "ms", 100, 5000, 1000, false},
    {"profile_velocity_m_s", "m/s", 0, 10, 0, true},
    {"profile_acceleration_m_s2", "m/s2", 0, 100, 0, true},
    {"duty_slew_per_s", "1/s", 0, 1000, 0, true},
    {"position_limit_min_m", "m", -100, -0.01F, -100, true},
    {"position_limit_max_m", "m", 0.01F, 100, 100, true},
    {"power_limit_duty", "", 0.1F, 1, 0.9F, true},
    {"power_limit_s", "s", 0.1F, 600, 60, true},
}};

}  // namespace

const ParameterSpec& Parameters::spec(std::size_t index) { return kTable[index]; }

std::optional<std::size_t> Parameters::find(const char* name) {
  for (std::size_t i = 0; i < kTable.size(); ++i) {
    if (std::strcmp(kTable[i].name, name) == 0) return i;
  }
  return std::nullopt;
}

bool Parameters::in_range(std::size_t index, float value) {
  return std::isfinite(value) && value >= kTable[index].minimum && value <= kTable[index].maximum;
}

void Parameters::set_defaults() {
  for (std::size_t i = 0; i < kTable.size(); ++i) values_[i] = kTable[i].default_value;
}

std::uint32_t Parameters::checksum() const {
  Crc32 crc;
  for (std::size_t i = 0; i < kTable.size(); ++i) {
    crc.add(kTable[i].name, std::strlen(kTable[i].name));
    crc.add_float(values_[i]);
  }
  return crc.value();
}

}  // namespace robot_fw
