// From the columns of a frame to samples and what they share.
#include "server/station/state/telemetry_fields.hpp"

#include <cmath>

namespace server::station {

SampleContext context_of(const protocol::Telemetry& telemetry) {
  SampleContext context;
  context.period_us = telemetry.period_us;
  for_each_batch_field([&]<class Value>(const BatchField<Value>& field) {
    const auto value = telemetry.*field.wire;
    if constexpr (BatchField<Value>::kKind == FieldKind::number) {
      const bool is_there = (field.has == nullptr || telemetry.*field.has) && std::isfinite(value);
      context.*field.member = is_there ? std::optional{value} : std::nullopt;
    } else {
      context.*field.member = value;
    }
  });
  return context;
}

void copy_samples(const protocol::Telemetry& telemetry, std::vector<Sample>& into) {
  into.resize(telemetry.position_m_count);
  for (std::size_t i = 0; i < into.size(); ++i) {
    for_each_sample_field([&](const SampleField& field) { into[i].*field.member = (telemetry.*field.wire)[i]; });
  }
}

}  // namespace server::station
