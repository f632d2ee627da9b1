// Reads the bodies of requests: control, runs, markers.
#include <fmt/format.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "server/api/bodies/limits.hpp"

namespace server::api {
namespace {

using nlohmann::json;

Result<void> read_text(const Members& body, const char* name, Range<std::size_t> bytes, std::string& into) {
  if (!body.has(name)) return {};
  auto value = body.text(name, bytes);
  if (!value) return std::unexpected{value.error()};
  into = std::move(*value);
  return {};
}

Result<storage::RecordedRange> read_range(const json& value) {
  if (!value.is_object()) return fail(ErrorCode::bad_request, "span is not an object", "wrong_type");
  const Members span{value};
  if (span.has("boot_id")) {
    if (auto known = span.only({"boot_id", "first_seq", "last_seq"}); !known) return std::unexpected{known.error()};
    const auto boot_id = span.id("boot_id");
    if (!boot_id) return std::unexpected{boot_id.error()};
    const auto first = span.integer("first_seq", integers("SeqSpan.first_seq"));
    if (!first) return std::unexpected{first.error()};
    const auto last = span.integer("last_seq", {*first, integers("SeqSpan.last_seq").maximum});
    if (!last) return std::unexpected{last.error()};
    return storage::SeqSpan{*boot_id, static_cast<std::uint64_t>(*first), static_cast<std::uint64_t>(*last)};
  }
  if (auto known = span.only({"from_us", "to_us"}); !known) return std::unexpected{known.error()};
  const auto from_us = span.integer("from_us", integers("TimeSpan.from_us"));
  if (!from_us) return std::unexpected{from_us.error()};
  const auto to_us = span.integer("to_us", {*from_us, integers("TimeSpan.to_us").maximum});
  if (!to_us) return std::unexpected{to_us.error()};
  return storage::TimeSpan{*from_us, *to_us};
}

// By name: of several faults the first is answered.
constexpr std::pair<const char*, Range<std::size_t>> kAnnotationTexts[] = {
    {"fluid", text_bytes("RunAnnotationBody.fluid")},
    {"name", text_bytes("RunAnnotationBody.name")},
    {"notes", text_bytes("RunAnnotationBody.notes")},
    {"operator_name", text_bytes("RunAnnotationBody.operator_name")},
    {"profile", text_bytes("RunAnnotationBody.profile")},
    {"pump_profile", text_bytes("RunAnnotationBody.pump_profile")},
    {"tube", text_bytes("RunAnnotationBody.tube")},
    {"verdict", text_bytes("RunAnnotationBody.verdict")},
};

}  // namespace

Result<ParsedControl> parse_control(const std::string& text) {
  const auto body = Members::parse(text, {"action", "lease_ms", "reason", "stamp_us"});
  if (!body) return std::unexpected{body.error()};
  const auto action = body->text("action", {1, kMaxWordBytes});
  if (!action) return std::unexpected{action.error()};
  constexpr std::pair<const char*, station::ControlAction> kActions[] = {
      {"take", station::ControlAction::take},
      {"force", station::ControlAction::force},
      {"release", station::ControlAction::release},
      {"request", station::ControlAction::request},
      {"hand_over", station::ControlAction::hand_over}};
  const auto* known = std::ranges::find(kActions, *action, [](const auto& one) { return std::string{one.first}; });
  if (known == std::end(kActions)) {
    return fail(ErrorCode::invalid,
                fmt::format("action = '{}' is none of take, force, release, request, hand_over", action->substr(0, 40)),
                "out_of_range");
  }
  ParsedControl control;
  station::ControlRequest& request = control.request;
  request.action = known->second;
  const bool is_forced = request.action == station::ControlAction::force;
  if (body->has("stamp_us") && request.action != station::ControlAction::take && !is_forced) {
    return fail(ErrorCode::bad_request, "stamp_us goes with take and force only", "unknown_member");
  }
  if (auto read = body->time("stamp_us", control.stamp_us); !read) return std::unexpected{read.error()};
  if (body->has("lease_ms")) {
    if (request.action != station::ControlAction::take) {
      return fail(ErrorCode::bad_request, "lease_ms goes with take only", "unknown_member");
    }
    const auto lease_ms = body->integer("lease_ms", integers("ControlBody.lease_ms"));
    if (!lease_ms) return std::unexpected{lease_ms.error()};
    request.lease = std::chrono::milliseconds{*lease_ms};
  }
  if (!is_forced && body->has("reason")) {
    return fail(ErrorCode::bad_request, "reason goes with force only", "unknown_member");
  }
  if (is_forced) {
    auto reason = body->text("reason", text_bytes("ControlBody.reason"));
    if (!reason) return std::unexpected{reason.error()};
    request.reason = std::move(*reason);
  }
  return control;
}

Result<RunRequest> parse_run(const std::string& text) {
  const auto body = Members::parse(text, {"robot_id", "name", "fluid", "pump_profile", "mean_flow_m_s", "tube",
                                          "operator_name", "profile", "notes", "span"});
  if (!body) return std::unexpected{body.error()};
  RunRequest request;
  const auto robot_id = body->text("robot_id", {0, kMaxLongWordBytes});
  if (!robot_id) return std::unexpected{robot_id.error()};
  if (!is_robot_id(*robot_id)) {
    return fail(ErrorCode::invalid, "robot_id is not 1 to 31 characters of [a-z0-9_-]", "out_of_range");
  }
  request.robot_id = *robot_id;
  const auto name = body->text("name", text_bytes("RunBody.name"));
  if (!name) return std::unexpected{name.error()};
  storage::RunConditions& conditions = request.conditions;
  conditions.name = *name;
  if (body->has("mean_flow_m_s")) {
    const auto flow = body->number("mean_flow_m_s");
    if (!flow) return std::unexpected{flow.error()};
    conditions.mean_flow_m_s = *flow;
  }
  const std::tuple<const char*, Range<std::size_t>, std::string*> texts[] = {
      {"fluid", text_bytes("RunBody.fluid"), &conditions.fluid},
      {"pump_profile", text_bytes("RunBody.pump_profile"), &conditions.pump_profile},
      {"tube", text_bytes("RunBody.tube"), &conditions.tube},
      {"operator_name", text_bytes("RunBody.operator_name"), &conditions.operator_name},
      {"profile", text_bytes("RunBody.profile"), &conditions.profile},
      {"notes", text_bytes("RunBody.notes"), &conditions.notes}};
  for (const auto& [member, bytes, into] : texts) {
    if (auto read = read_text(*body, member, bytes, *into); !read) return std::unexpected{read.error()};
  }
  if (!body->has("span")) return request;
  auto range = read_range(body->object().at("span"));
  if (!range) return std::unexpected{range.error()};
  request.range = *range;
  return request;
}

Result<std::string> parse_run_end(const std::string& text) {
  std::string verdict;
  if (text.empty()) return verdict;
  const auto body = Members::parse(text, {"verdict"});
  if (!body) return std::unexpected{body.error()};
  if (auto read = read_text(*body, "verdict", text_bytes("RunEndBody.verdict"), verdict); !read)
    return std::unexpected{read.error()};
  return verdict;
}

Result<storage::RunAnnotation> parse_annotation(const std::string& text) {
  const auto body = Members::parse(
      text, {"name", "fluid", "pump_profile", "mean_flow_m_s", "tube", "operator_name", "profile", "notes", "verdict"});
  if (!body) return std::unexpected{body.error()};
  storage::RunAnnotation annotation;
  for (const auto& [member, bytes] : kAnnotationTexts) {
    if (!body->has(member)) continue;
    const auto given = body->text(member, bytes);
    if (!given) return std::unexpected{given.error()};
    annotation.texts[member] = *given;
  }
  annotation.has_mean_flow = body->has("mean_flow_m_s");
  if (!annotation.has_mean_flow || body->object().at("mean_flow_m_s").is_null()) return annotation;
  const auto flow = body->number("mean_flow_m_s");
  if (!flow) return std::unexpected{flow.error()};
  annotation.mean_flow_m_s = *flow;
  return annotation;
}

Result<std::string> parse_discard(const std::string& text) {
  const auto body = Members::parse(text, {"reason"});
  if (!body) return std::unexpected{body.error()};
  return body->text("reason", text_bytes("RunDiscardBody.reason"));
}

Result<std::uint64_t> parse_finalize(const std::string& text) {
  const auto body = Members::parse(text, {"samples_missing"});
  if (!body) return std::unexpected{body.error()};
  const auto samples = body->integer("samples_missing", integers("RunFinalizeBody.samples_missing"));
  if (!samples) return std::unexpected{samples.error()};
  return static_cast<std::uint64_t>(*samples);
}

Result<MarkerBody> parse_marker(const std::string& text) {
  const auto body = Members::parse(text, {"text", "at_us"});
  if (!body) return std::unexpected{body.error()};
  const auto said = body->text("text", text_bytes("MarkerBody.text"));
  if (!said) return std::unexpected{said.error()};
  MarkerBody marker{*said, {}};
  if (!body->has("at_us")) return marker;
  const auto at_us = body->integer("at_us", integers("MarkerBody.at_us"));
  if (!at_us) return std::unexpected{at_us.error()};
  marker.at_us = *at_us;
  return marker;
}

}  // namespace server::api
