// The audit: who did what, when, from where, and what came of it.
#include "server/api/bodies/limits.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/storage/audit/audit_queries.hpp"
#include "server/storage/ingest/recorder.hpp"
#include "server/storage/query/history.hpp"

namespace server::api {
using nlohmann::json;

namespace {

constexpr std::size_t kMaxFilterBytes = 100;
constexpr std::int64_t kMaxNumber = kMaxJavaScriptInteger;

json to_json(const storage::AuditEntry& entry) {
  const station::AuditNote& note = entry.note;
  json out;
  out["entry"] = entry.entry;
  out["at_us"] = note.by.at_us;
  out["actor"] = note.by.actor;
  out["peer"] = note.by.peer;
  out["robot_id"] = note.robot_id;
  out["action"] = note.action;
  out["subject"] = note.subject;
  out["detail"] = json::parse(note.detail, nullptr, false);
  if (out["detail"].is_discarded()) out["detail"] = note.detail;
  out["hash"] = storage::text(entry.hash);
  return out;
}

std::optional<std::string> word_of(const http::Request& request, const char* name) {
  const auto given = request.query.find(name);
  return given == request.query.end() ? std::nullopt : std::optional{given->second.substr(0, kMaxFilterBytes)};
}

Result<storage::AuditFilter> filter_of(const http::Request& request) {
  storage::AuditFilter filter;
  filter.robot_id = word_of(request, "robot_id");
  if (filter.robot_id != "") {  // empty: the station itself
    if (auto robot = query_robot(request); !robot) return std::unexpected{robot.error()};
  }
  filter.actor = word_of(request, "actor");
  filter.action = word_of(request, "action");
  const auto window = query_window(request);
  if (!window) return std::unexpected{window.error()};
  if (*window) {
    filter.from_us = (*window)->from_us;
    filter.to_us = (*window)->to_us;
  }
  const auto before = query_number_cursor(request, "before");
  if (!before) return std::unexpected{before.error()};
  filter.before = *before;
  const auto limit = query_limit(request);
  if (!limit) return std::unexpected{limit.error()};
  filter.limit = *limit;
  return filter;
}

http::Answer list_audit(AuditRoutes parts, http::Request request) {
  const auto filter = filter_of(request);
  if (!filter) co_return http::problem(filter.error());
  const storage::AuditPage page = co_await parts.history.audit(*filter);
  json body{{"entries", json::array()}};
  for (const storage::AuditEntry& entry : page.entries) body["entries"].push_back(to_json(entry));
  body["next"] = page.next == 0 ? json(nullptr) : json(page.next);
  body["head"] = page.head.entry == 0 ? json(nullptr) : json(text(page.head));
  co_return http::json_response(200, body);
}

}  // namespace

void add_audit_routes(http::Router& router, AuditRoutes parts) {
  router.add({"GET",
              "/api/v1/audit",
              identity::Scope::admin,
              {"robot_id", "actor", "action", "from_us", "to_us", "before", "limit"},
              with(parts, list_audit)});
  router.set_on_refused([parts](const http::Request& request, identity::Scope needed) {
    station::AuditNote note;
    note.by = author_of(request, parts.clock);
    note.action = "request.refused";
    note.subject = request.path.substr(0, kMaxFilterBytes);
    note.detail = station::audit_detail({{"method", request.method}, {"needs", text(needed)}});
    note.can_flood = true;
    parts.recorder.on_audit(note);
  });
}

}  // namespace server::api
