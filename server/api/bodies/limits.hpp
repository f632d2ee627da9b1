// The limits of request bodies, each once: the parsers take them from these tables, and limits_test compares the tables
// with server/api/openapi.yaml in both directions.
//
// A property is named by its schema and itself: "RunBody.name", "LifeMs", "SetDutyScheduleBody.schedule[].tick".
// Texts are counted in bytes of UTF-8. The maxLength of the document is the same number, of characters; so a text that
// is not ASCII is refused although it has fewer characters than that.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <string_view>

#include "server/analysis/comparison/aligned_runs.hpp"
#include "server/analysis/identify_job.hpp"
#include "server/analysis/reference_import.hpp"
#include "server/analysis/tuning/tune_job.hpp"
#include "server/analysis/tuning/tuning_ranges.hpp"
#include "server/api/bodies/json.hpp"
#include "server/identity/accounts.hpp"
#include "server/runtime/secrets.hpp"
#include "server/station/state/fluid_model.hpp"

namespace server::api {

template <class Number>
struct Limit {
  std::string_view property;
  Range<Number> range;
};

inline constexpr std::int64_t kMaxUint32 = std::numeric_limits<std::uint32_t>::max();
inline constexpr std::int64_t kMaxJavaScriptInteger = 9'007'199'254'740'991;
inline constexpr std::int64_t kMostTracesMs = 86'400'000;
inline constexpr double kLongestReservation_s = station::kLongestReservation / std::chrono::seconds{1};
inline constexpr Range<std::size_t> kNameBytes{1, 200}, kTextBytes{0, 4000}, kReasonBytes{1, 4000};
inline constexpr Range<double> kReferenceSeconds{-1e10, 1e10}, kReferenceClockSd_s{0, 1000};

// The length of a text with an enum or a pattern in the document. Longer ones are refused by their length alone.
inline constexpr std::size_t kMaxWordBytes = 200;
inline constexpr std::size_t kMaxLongWordBytes = 4000;

inline constexpr std::size_t kMaxDocumentBytes = 16'384;  // of a fluid's model: its texts and plant together

inline constexpr Range<double> kCrossovers_rad_s{analysis::kLowestCrossover_rad_s, analysis::kHighestCrossover_rad_s};
inline constexpr Range<double> kMarginsDeg{analysis::kSmallestMarginDeg, analysis::kLargestMarginDeg};
inline constexpr Range<double> kMus{analysis::kLowestMu, analysis::kHighestMu};

inline constexpr Limit<std::size_t> kTextLimits[] = {
    // bytes: minLength, maxLength
    {"ControlBody.reason", kNameBytes},
    {"DesignBody.name", kNameBytes},
    {"DesignBody.notes", kTextBytes},
    {"ExperimentAbortBody.reason", kTextBytes},
    {"ExperimentBody.notes", kTextBytes},
    {"ExperimentBody.profile", {1, 32'000}},
    {"ExportJobBody.channels", kNameBytes},
    {"FluidBody.fluid", kNameBytes},
    {"FluidModelBody.comment", {0, kMaxDocumentBytes}},
    {"FluidModelBody.confirmed_because", {1, 1000}},
    {"FluidModelBody.description", {0, kMaxDocumentBytes}},
    {"FluidModelBody.name", {0, kMaxDocumentBytes}},
    {"LoginBody.password", {0, 10 * runtime::kMaxPasswordBytes}},
    {"LoginBody.user", {0, kMaxWordBytes}},
    {"MarkerBody.text", kReasonBytes},
    {"OwnModelBody.fluid", kNameBytes},
    {"ReferenceBody.csv", {1, analysis::kMaxReferenceBytes}},
    {"ReferenceBody.reason", kReasonBytes},
    {"ReferenceBody.source", kNameBytes},
    {"ReferenceClock.marker_text", kReasonBytes},
    {"ReservationBody.holder", kNameBytes},
    {"ReservationBody.purpose", {0, 200}},
    {"RunAnnotationBody.fluid", kTextBytes},
    {"RunAnnotationBody.name", kNameBytes},
    {"RunAnnotationBody.notes", kTextBytes},
    {"RunAnnotationBody.operator_name", kTextBytes},
    {"RunAnnotationBody.profile", kTextBytes},
    {"RunAnnotationBody.pump_profile", kTextBytes},
    {"RunAnnotationBody.tube", kTextBytes},
    {"RunAnnotationBody.verdict", kTextBytes},
    {"RunBody.fluid", kTextBytes},
    {"RunBody.name", kNameBytes},
    {"RunBody.notes", kTextBytes},
    {"RunBody.operator_name", kTextBytes},
    {"RunBody.profile", kTextBytes},
    {"RunBody.pump_profile", kTextBytes},
    {"RunBody.tube", kTextBytes},
    {"RunDiscardBody.reason", kReasonBytes},
    {"RunEndBody.verdict", kTextBytes},
    {"ScopeList", {1, kMaxWordBytes}},
    {"SetParameterBody.name", {1, sizeof(rheonaut_SetParameter::name) - 1}},
    {"TracesBody.channels", kNameBytes},
    {"TracesBody.event", kNameBytes},
    {"TracesBody.marker", kReasonBytes},
    {"TuneJobBody.fluid", kNameBytes},
    {"TuningMapJobBody.fluid", kNameBytes},
    {"UserBody.password", {runtime::kMinPasswordBytes, runtime::kMaxPasswordBytes}},
    {"UserChange.password", {runtime::kMinPasswordBytes, runtime::kMaxPasswordBytes}},
};

inline constexpr Limit<std::int64_t> kIntegerLimits[] = {
    // minimum, maximum
    {"ComparisonJobBody.runs[]", {1, kMaxJavaScriptInteger}},
    {"ControlBody.lease_ms", {1, station::kLongestControl.count() / 1000}},
    {"ControlBody.stamp_us", {0, kMaxTimeUs}},
    {"Controller.checksum", {0, kMaxUint32}},
    {"Controller.controller_id", {1, kMaxUint32}},
    {"Controller.period_us", {1, 10'000'000}},
    {"DesignBody.job_id", {1, kMaxJavaScriptInteger}},
    {"DesignBody.model_id", {1, kMaxJavaScriptInteger}},
    {"DesignBody.parent_id", {1, kMaxJavaScriptInteger}},
    {"DesignBody.runs[].run_id", {1, kMaxJavaScriptInteger}},
    {"DesignBody.runs[].span", {0, 1'000'000}},
    {"ExecuteAtRobotUs", {0, kMaxTimeUs}},
    {"ExperimentBody.priority", {-100, 100}},
    {"ExperimentMoveBody.before", {1, kMaxJavaScriptInteger}},
    {"ExperimentMoveBody.priority", {-100, 100}},
    {"ExportJobBody.grid_us", {100, 3'600'000'000}},
    {"ExportJobBody.run_id", {1, kMaxJavaScriptInteger}},
    {"GetParametersBody.first_index", {0, 255}},
    {"IdentifyJobBody.run_id", {1, kMaxJavaScriptInteger}},
    {"IdentifyJobBody.runs[].run_id", {1, kMaxJavaScriptInteger}},
    {"IdentifyJobBody.runs[].span", {0, 1'000'000}},
    {"IdentifyJobBody.span", {0, 1'000'000}},
    {"IdentifyJobBody.validation_run_id", {1, kMaxJavaScriptInteger}},
    {"IdentifyJobBody.validation_span", {0, 1'000'000}},
    {"KeepAliveBody.stamp_us", {0, kMaxTimeUs}},
    {"IssuedAtUs", {0, kMaxTimeUs}},
    {"LifeMs", {1, protocol::kMaxTimeToLiveUs / 1000}},
    {"MarkerBody.at_us", {0, kMaxTimeUs - 1}},
    {"RunFinalizeBody.samples_missing", {0, kMaxJavaScriptInteger}},
    {"PushControllerBody.design_id", {1, kMaxJavaScriptInteger}},
    {"PushControllerBody.life_ms", {1, protocol::kMaxTimeToLiveUs / 1000}},
    {"ReferenceBody.span", {0, 1'000'000}},
    {"ReferenceClock.marker_id", {1, kMaxJavaScriptInteger}},
    {"ReferenceClock.zero_at_us", {0, kMaxJavaScriptInteger}},
    {"RenewLeaseBody.lease_ms", {1, protocol::kLeaseMs}},
    {"ReportJobBody.runs[]", {1, kMaxJavaScriptInteger}},
    {"SeqSpan.first_seq", {0, kMaxTimeUs - 1}},
    {"SeqSpan.last_seq", {0, kMaxTimeUs - 1}},  // from first_seq on
    {"ReservationBody.from_us", {0, kMaxTimeUs}},
    {"ReservationBody.until_us", {0, kMaxTimeUs}},
    {"SetControllerBody.controller_id", {1, kMaxUint32}},
    {"SetDutyBody.lease_ms", {1, protocol::kLeaseMs}},
    {"SetDutyScheduleBody.schedule[].tick", {0, kMaxUint32}},
    {"StampUs", {0, kMaxTimeUs}},
    {"TimeSpan.from_us", {0, kMaxTimeUs - 1}},
    {"TimeSpan.to_us", {0, kMaxTimeUs - 1}},  // from from_us on
    {"TokenBody.days", {1, identity::kMaxTokenDays}},
    {"TracesBody.from_ms", {-kMostTracesMs, kMostTracesMs}},
    {"TracesBody.grid_us", {analysis::kFinestGrid_us, analysis::kCoarsestGrid_us}},
    {"TracesBody.number", {1, analysis::kMostAlignmentNumber}},
    {"TracesBody.reference_run_id", {1, kMaxJavaScriptInteger}},
    {"TracesBody.to_ms", {-kMostTracesMs, kMostTracesMs}},
    {"TuneJobBody.model_id", {1, kMaxJavaScriptInteger}},
    {"TuneMeasuredJobBody.run_id", {1, kMaxJavaScriptInteger}},
    {"TuneMeasuredJobBody.span", {0, 1'000'000}},
    {"TuningMapJobBody.model_id", {1, kMaxJavaScriptInteger}},
    {"TuningMapJobBody.points", {2, control::kMostMapPoints}},
};

inline constexpr Limit<double> kNumberLimits[] = {
    // minimum or exclusiveMinimum, maximum
    {"DiscretisedController.period_s", {0, 10}},  // not 0
    {"FluidModelBody.fit_error", {0, station::kMaxModelFitError}},
    {"FluidModelBody.model_gain_m_s[]", {-station::kMaxModelGain_m_s, station::kMaxModelGain_m_s}},
    {"FluidModelBody.model_time_constant_s[]", {station::kMinModelTimeConstant_s, station::kMaxModelTimeConstant_s}},
    {"IdentifyJobBody.dead_time_s", {0, 1000}},
    {"IdentifyJobBody.from_s", {0, 1e6}},
    {"IdentifyJobBody.runs[].from_s", {0, 1e6}},
    {"IdentifyJobBody.runs[].to_s", {0, 1e6}},
    {"IdentifyJobBody.sensor_lag_s", {0, 1000}},
    {"IdentifyJobBody.time_limit_s", {0.1, 600}},
    {"IdentifyJobBody.to_s", {0, 1e6}},
    {"IdentifyJobBody.validation_from_s", {0, 1e6}},
    {"IdentifyJobBody.validation_to_s", {0, 1e6}},
    {"ReferenceBody.sd_m", {1e-7, 1}},
    {"ReferenceClock.at_s", kReferenceSeconds},
    {"ReferenceClock.from_s", kReferenceSeconds},
    {"ReferenceClock.offset_s", kReferenceSeconds},
    {"ReferenceClock.sd_s", kReferenceClockSd_s},
    {"ReferenceClock.to_s", kReferenceSeconds},
    {"ReservationBody.for_s", {1, kLongestReservation_s}},
    {"TuneJobBody.crossover_rad_s", kCrossovers_rad_s},
    {"TuneJobBody.duty_max", {0.01, 1}},
    {"TuneJobBody.duty_min", {-1, 0}},
    {"TuneJobBody.mu", kMus},
    {"TuneJobBody.period_s", {0.001, analysis::kLongestPeriod_s}},
    {"TuneJobBody.phase_margin_deg", kMarginsDeg},
    {"TuneMeasuredJobBody.crossover_rad_s", kCrossovers_rad_s},
    {"TuneMeasuredJobBody.duty_max", {0.01, 1}},
    {"TuneMeasuredJobBody.duty_min", {-1, 0}},
    {"TuneMeasuredJobBody.mu", kMus},
    {"TuneMeasuredJobBody.period_s", {0.001, analysis::kLongestPeriod_s}},
    {"TuneMeasuredJobBody.phase_margin_deg", kMarginsDeg},
    {"TuningMapJobBody.from_rad_s", kCrossovers_rad_s},
    {"TuningMapJobBody.to_rad_s", kCrossovers_rad_s},
};

// SAFETY: the robot refuses what is outside; the station passes it on, since what it knows of a robot may be old.
inline constexpr Limit<double> kLimitsOfTheRobot[] = {
    {"PushControllerBody.duty_max", {0, 1}},                                                   // not 0
    {"PushControllerBody.duty_min", {-1, 0}},         {"SetControllerBody.duty_max", {0, 1}},  // not 0
    {"SetControllerBody.duty_min", {-1, 0}},          {"SetDutyBody.duty", {-1, 1}},
    {"SetDutyScheduleBody.schedule[].duty", {-1, 1}},
};

inline constexpr Limit<std::size_t> kListLimits[] = {
    // minItems, maxItems
    {"ComparisonJobBody.runs", {2, analysis::kMostAlignedRuns}},
    {"Controller.biquad_a1", {0, std::size(rheonaut_Controller{}.biquad_a1)}},
    {"Controller.biquad_a2", {0, std::size(rheonaut_Controller{}.biquad_a2)}},
    {"Controller.biquad_b0", {0, std::size(rheonaut_Controller{}.biquad_b0)}},
    {"Controller.biquad_b1", {0, std::size(rheonaut_Controller{}.biquad_b1)}},
    {"Controller.pole", {0, std::size(rheonaut_Controller{}.pole)}},
    {"Controller.residue", {0, std::size(rheonaut_Controller{}.residue)}},
    {"DesignBody.runs", {0, 100}},
    {"FluidModelBody.model_gain_m_s", {station::kFluidModelSections, station::kFluidModelSections}},
    {"FluidModelBody.model_time_constant_s", {station::kFluidModelSections, station::kFluidModelSections}},
    {"IdentifyJobBody.runs", {1, control::kMostRecordings}},
    {"ReportJobBody.runs", {1, analysis::kMostAlignedRuns}},
    {"SetDutyScheduleBody.schedule", {1, std::size(rheonaut_SetDutySchedule{}.duty)}},
};

// The range of a property; one that the table does not have is an error of the compiler.
template <class Number, std::size_t size>
consteval Range<Number> limit_in(const Limit<Number> (&table)[size], std::string_view property) {
  for (const Limit<Number>& limit : table) {
    if (limit.property == property) return limit.range;
  }
  throw "no such property";
}
consteval Range<std::size_t> text_bytes(std::string_view property) { return limit_in(kTextLimits, property); }
consteval Range<std::int64_t> integers(std::string_view property) { return limit_in(kIntegerLimits, property); }
consteval Range<double> numbers(std::string_view property) { return limit_in(kNumberLimits, property); }
consteval Range<std::size_t> list_size(std::string_view property) { return limit_in(kListLimits, property); }

}  // namespace server::api
