// Positions of a run that were measured from outside: imported, shown, removed.
#include <fmt/format.h>

#include <cmath>

#include "server/analysis/analysis_service.hpp"
#include "server/api/bodies/limits.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/storage/runs/outside_references.hpp"

namespace server::api {
using nlohmann::json;

namespace {

constexpr std::int64_t kMaxPagePositions = 10'000;

Result<double> needed_number(const Members& body, const char* name, Range<double> allowed) {
  const auto value = body.optional_number(name, allowed);
  if (!value) return std::unexpected{value.error()};
  if (*value) return **value;
  return fail(ErrorCode::bad_request, fmt::format("{} is missing", name), "missing_member");
}

Result<void> parse_marker_clock(const Members& body, analysis::ReferenceClockRequest& clock) {
  const auto at_s = needed_number(body, "at_s", numbers("ReferenceClock.at_s"));
  if (!at_s) return std::unexpected{at_s.error()};
  clock.at_s = *at_s;
  if (body.has("marker_id")) {
    const auto id = body.integer("marker_id", integers("ReferenceClock.marker_id"));
    if (!id) return std::unexpected{id.error()};
    clock.marker_id = *id;
    return {};
  }
  const auto said = body.text("marker_text", text_bytes("ReferenceClock.marker_text"));
  if (!said) return std::unexpected{said.error()};
  clock.marker_text = *said;
  return {};
}

Result<void> parse_search(const Members& body, analysis::ReferenceClockRequest& clock) {
  const auto from_s = body.optional_number("from_s", numbers("ReferenceClock.from_s"));
  if (!from_s) return std::unexpected{from_s.error()};
  const auto to_s = body.optional_number("to_s", numbers("ReferenceClock.to_s"));
  if (!to_s) return std::unexpected{to_s.error()};
  clock.search.from_s = from_s->value_or(clock.search.from_s);
  clock.search.to_s = to_s->value_or(clock.search.to_s);
  if (clock.search.from_s < clock.search.to_s) return {};
  return fail(ErrorCode::invalid, "from_s must be below to_s", "out_of_range");
}

Result<analysis::ReferenceClockRequest> parse_clock(const json& given) {
  if (!given.is_object()) return fail(ErrorCode::bad_request, "clock must be an object", "wrong_type");
  const Members body{given};
  const auto method = body.text("method", {1, 20});
  if (!method) return std::unexpected{method.error()};
  analysis::ReferenceClockRequest clock;
  const auto only = [&](std::initializer_list<const char*> known) { return body.only(known); };
  Result<void> read;
  if (*method == text(storage::ReferenceClock::offset)) {
    clock.method = storage::ReferenceClock::offset;
    read = only({"method", "sd_s", "offset_s"});
    const auto offset_s = needed_number(body, "offset_s", numbers("ReferenceClock.offset_s"));
    if (read && !offset_s) read = std::unexpected{offset_s.error()};
    clock.offset_s = offset_s.value_or(0);
  } else if (*method == text(storage::ReferenceClock::utc)) {
    clock.method = storage::ReferenceClock::utc;
    read = only({"method", "sd_s", "zero_at_us"});
    const auto zero_at_us = body.integer("zero_at_us", integers("ReferenceClock.zero_at_us"));
    if (read && !zero_at_us) read = std::unexpected{zero_at_us.error()};
    clock.zero_at_us = zero_at_us.value_or(0);
  } else if (*method == text(storage::ReferenceClock::marker)) {
    clock.method = storage::ReferenceClock::marker;
    read = only({"method", "sd_s", "marker_id", "marker_text", "at_s"});
    if (read) read = parse_marker_clock(body, clock);
  } else if (*method == text(storage::ReferenceClock::correlation)) {
    read = only({"method", "from_s", "to_s"});
    if (read) read = parse_search(body, clock);
  } else {
    return fail(ErrorCode::invalid, "clock.method is none of offset, utc, marker and correlation", "out_of_range");
  }
  if (!read) return std::unexpected{read.error()};
  const auto sd_s = body.optional_number("sd_s", numbers("ReferenceClock.sd_s"));
  if (!sd_s) return std::unexpected{sd_s.error()};
  clock.sd_s = *sd_s;
  return clock;
}

Result<analysis::ReferenceRequest> parse_reference(const std::string& text) {
  auto body = Members::parse(text, {"csv", "source", "clock", "span", "keep_zero", "metres", "sd_m", "reason"});
  if (!body) return std::unexpected{body.error()};
  analysis::ReferenceRequest request;
  auto csv = body->text("csv", text_bytes("ReferenceBody.csv"));
  if (!csv) return std::unexpected{csv.error()};
  request.csv = std::move(*csv);
  const auto source = body->text("source", text_bytes("ReferenceBody.source"));
  if (!source) return std::unexpected{source.error()};
  request.source = *source;
  if (!body->has("clock")) return fail(ErrorCode::bad_request, "clock is missing", "missing_member");
  auto clock = parse_clock(body->object().at("clock"));
  if (!clock) return std::unexpected{clock.error()};
  request.clock = std::move(*clock);
  if (body->has("span")) {
    const auto span = body->integer("span", integers("ReferenceBody.span"));
    if (!span) return std::unexpected{span.error()};
    request.span = static_cast<std::uint32_t>(*span);
  }
  const auto keeps_zero = body->flag("keep_zero"), is_in_metres = body->flag("metres");
  if (!keeps_zero) return std::unexpected{keeps_zero.error()};
  if (!is_in_metres) return std::unexpected{is_in_metres.error()};
  request.keeps_zero = *keeps_zero;
  request.is_in_metres = *is_in_metres;
  const auto sd_m = body->optional_number("sd_m", numbers("ReferenceBody.sd_m"));
  if (!sd_m) return std::unexpected{sd_m.error()};
  request.sd_m = *sd_m;
  if (!body->has("reason")) return request;
  const auto reason = body->text("reason", text_bytes("ReferenceBody.reason"));
  if (!reason) return std::unexpected{reason.error()};
  request.reason = *reason;
  return request;
}

http::Answer import_reference(ReferenceRoutes parts, http::Request request) {
  const auto run = run_id_of(request);
  if (!run) co_return http::problem(run.error());
  const station::Author by = author_of(request, parts.clock);
  auto parse = [body = std::move(request.body)] { return parse_reference(body); };
  auto wanted = co_await parts.analysis.compute(std::move(parse));
  if (!wanted) co_return http::problem(wanted.error());
  storage::OutsideReferences& references = parts.references;
  const std::string reason = wanted->reason;
  const Result<void> may = co_await references.check(*run, reason);
  if (!may) co_return http::problem(may.error());
  std::optional<storage::MarkerPlace> marker;
  if (wanted->clock.method == storage::ReferenceClock::marker) {
    const auto found = co_await references.marker(*run, wanted->clock.marker_id, wanted->clock.marker_text);
    if (!found) co_return http::problem(found.error());
    marker = *found;
  }
  auto placed = co_await parts.analysis.place(*run, std::move(*wanted), marker);
  if (!placed) co_return http::problem(placed.error());
  placed->reference.run = *run;
  placed->reference.actor = by.actor;
  placed->reference.made_at_us = by.at_us;
  const auto made = co_await references.import(std::move(placed->reference), std::move(placed->positions), reason, by);
  if (!made) co_return http::problem(made.error());
  http::Response response = http::json_response(201, analysis::json_of(*made));
  response.headers.emplace_back("Location", fmt::format("/api/v1/runs/{}/reference", *run));
  co_return response;
}

http::Answer get_reference(ReferenceRoutes parts, http::Request request) {
  const auto run = run_id_of(request);
  if (!run) co_return http::problem(run.error());
  const auto found = co_await parts.references.find(*run);
  if (!found) co_return http::problem(found.error());
  co_return http::json_response(200, analysis::json_of(*found));
}

http::Answer remove_reference(ReferenceRoutes parts, http::Request request) {
  const auto run = run_id_of(request);
  if (!run) co_return http::problem(run.error());
  const auto reason = parse_discard(request.body);
  if (!reason) co_return http::problem(reason.error());
  const auto removed = co_await parts.references.remove(*run, *reason, author_of(request, parts.clock));
  if (!removed) co_return http::problem(removed.error());
  co_return http::json_response(200, analysis::json_of(*removed));
}

http::Answer list_positions(ReferenceRoutes parts, http::Request request) {
  const auto run = run_id_of(request);
  if (!run) co_return http::problem(run.error());
  const auto after = query_number_cursor(request, "after", -1);
  if (!after) co_return http::problem(after.error());
  const auto limit = query_number(request, "limit", 1, kMaxPagePositions, kMaxPagePositions);
  if (!limit) co_return http::problem(limit.error());
  const auto after_us = *after < 0 ? std::nullopt : std::optional{static_cast<std::uint64_t>(*after)};
  auto found = co_await parts.references.page(*run, after_us, static_cast<std::size_t>(*limit) + 1);
  if (!found) co_return http::problem(found.error());
  storage::OutsidePositions& positions = found->positions;
  const bool is_more = positions.size() > static_cast<std::size_t>(*limit);
  if (is_more) positions.resize(static_cast<std::size_t>(*limit));
  co_return http::json_response(200, {{"span", found->reference.span},
                                      {"robot_time_us", positions.robot_time_us},
                                      {"position_m", positions.position_m},
                                      {"position_sd_m", positions.position_sd_m},
                                      {"next", is_more ? json(positions.robot_time_us.back()) : json(nullptr)}});
}

}  // namespace

void add_reference_routes(http::Router& router, ReferenceRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    std::vector<std::string> query,
                                    http::Answer (*answer)(ReferenceRoutes, http::Request),
                                    std::size_t max_body_bytes = http::kMaxBodyBytes) {
    router.add({method, pattern, needs, std::move(query), with(parts, answer), false, max_body_bytes});
  };
  add("POST", "/api/v1/runs/{run_id}/reference", identity::Scope::record, {}, import_reference,
      analysis::kMaxReferenceBytes);
  add("GET", "/api/v1/runs/{run_id}/reference", identity::Scope::read, {}, get_reference);
  add("POST", "/api/v1/runs/{run_id}/reference/remove", identity::Scope::record, {}, remove_reference);
  add("GET", "/api/v1/runs/{run_id}/reference/positions", identity::Scope::read, {"after", "limit"}, list_positions);
}

}  // namespace server::api
