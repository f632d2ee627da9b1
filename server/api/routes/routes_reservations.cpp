// Reservations of robots: made, listed, cancelled.
#include <fmt/format.h>

#include "server/api/bodies/json.hpp"
#include "server/api/bodies/limits.hpp"
#include "server/api/bodies/query_params.hpp"
#include "server/api/routes/routes.hpp"
#include "server/identity/auth.hpp"
#include "server/station/station.hpp"
#include "server/storage/reservations/reservation_book.hpp"

namespace server::api {
using nlohmann::json;
using station::Reservation;

namespace {

Result<station::ReservationId> reservation_id_of(const http::Request& request) {
  const std::string& given = request.param.at("reservation_id");
  const auto id = parse_id(given);
  if (id && *id <= static_cast<std::uint64_t>(kMaxRunId)) return static_cast<station::ReservationId>(*id);
  return fail(ErrorCode::not_found, fmt::format("there is no reservation '{}'", given.substr(0, 40)),
              "no_such_reservation");
}

// Its end, or how long it lasts.
Result<std::int64_t> parse_until(const Members& body, std::int64_t from_us) {
  if (body.has("until_us") == body.has("for_s")) {
    return fail(ErrorCode::bad_request, "a reservation has either until_us or for_s", "missing_member");
  }
  if (body.has("until_us")) return body.integer("until_us", integers("ReservationBody.until_us"));
  const auto for_s = body.optional_number("for_s", numbers("ReservationBody.for_s"));
  if (!for_s) return std::unexpected{for_s.error()};
  const auto lasts_us = static_cast<std::int64_t>(**for_s * 1e6);
  return from_us > kMaxTimeUs - lasts_us ? kMaxTimeUs : from_us + lasts_us;
}

// e.g. {"for_s":7200,"purpose":"tubes of bed 3"}; robot_id and a holder that is left out stay empty.
Result<Reservation> parse_reservation(const std::string& text, std::int64_t utc_us) {
  const auto body = Members::parse(text, {"from_us", "until_us", "for_s", "purpose", "holder"});
  if (!body) return std::unexpected{body.error()};
  Reservation wanted;
  wanted.from_us = utc_us;
  if (body->has("from_us")) {
    const auto from_us = body->integer("from_us", integers("ReservationBody.from_us"));
    if (!from_us) return std::unexpected{from_us.error()};
    wanted.from_us = *from_us;
  }
  const auto until_us = parse_until(*body, wanted.from_us);
  if (!until_us) return std::unexpected{until_us.error()};
  wanted.until_us = *until_us;
  if (body->has("purpose")) {
    auto purpose = body->text("purpose", text_bytes("ReservationBody.purpose"));
    if (!purpose) return std::unexpected{purpose.error()};
    wanted.purpose = std::move(*purpose);
  }
  if (body->has("holder")) {
    auto holder = body->text("holder", text_bytes("ReservationBody.holder"));
    if (!holder) return std::unexpected{holder.error()};
    wanted.holder = std::move(*holder);
  }
  return wanted;
}

bool is_admin(const http::Request& request) { return request.caller.scopes.allow(identity::Scope::admin); }

// The account that it is for: the caller's own, or for an administrator anybody's.
Result<std::string> holder_of(ReservationRoutes parts, const http::Request& request, const std::string& given) {
  std::string own = parts.station.account_of(request.actor);
  if (given.empty()) return own;
  std::string holder = parts.station.account_of(given);
  if (holder == own) return own;
  if (!is_admin(request)) {
    return fail(ErrorCode::forbidden, "only an administrator reserves a robot for somebody else", "not_permitted");
  }
  if (parts.accounts.is_account(holder)) return holder;
  return fail(ErrorCode::invalid,
              fmt::format("holder = '{}' is no account: user:NAME, token:NAME or session:NUMBER", given.substr(0, 40)),
              "unknown_name");
}

http::Answer make_reservation(ReservationRoutes parts, http::Request request) {
  const std::string robot_id = request.param.at("robot_id");
  if (parts.station.find(robot_id) == nullptr) co_return unknown_robot(robot_id);
  auto wanted = parse_reservation(request.body, parts.clock.utc_us());
  if (!wanted) co_return http::problem(wanted.error());
  auto holder = holder_of(parts, request, wanted->holder);
  if (!holder) co_return http::problem(holder.error(), identity::Role::admin);
  wanted->robot_id = robot_id;
  wanted->holder = std::move(*holder);
  if (auto stands = still_stands(request.caller); !stands) co_return http::problem(stands.error());
  const auto checked = parts.station.check_reservation(*wanted, is_admin(request));
  if (!checked) co_return http::problem(checked.error());
  const auto made = co_await parts.reservations.store(std::move(*wanted), author_of(request, parts.clock));
  if (!made) co_return http::problem(made.error());
  // SAFETY: somebody may have taken control meanwhile, and nobody loses it without notice.
  if (const auto still = parts.station.check_reservation(*made, is_admin(request)); !still) {
    static_cast<void>(co_await parts.reservations.cancel(made->id, author_of(request, parts.clock)));
    co_return http::problem(still.error());
  }
  parts.station.add_reservation(*made);
  co_return http::json_response(201, live::to_json(*made));
}

http::Answer list_reservations(ReservationRoutes parts, http::Request request) {
  const auto limit = query_limit(request);
  if (!limit) co_return http::problem(limit.error());
  const auto before = query_number_cursor(request, "before");
  if (!before) co_return http::problem(before.error());
  storage::ReservationFilter filter;
  filter.before = *before;
  filter.limit = *limit + 1;
  auto robot = query_robot(request);
  if (!robot) co_return http::problem(robot.error());
  filter.robot_id = std::move(*robot);
  const auto is_over = query_flag(request, "over");
  if (!is_over) co_return http::problem(is_over.error());
  filter.is_over = *is_over;
  const auto found = co_await parts.reservations.list(std::move(filter));
  const auto json_of = [](const Reservation& reservation) { return live::to_json(reservation); };
  const auto cursor_of = [](const Reservation& reservation) { return reservation.id; };
  co_return http::json_response(200, page_json("reservations", found, *limit, json_of, cursor_of));
}

http::Answer cancel_reservation(ReservationRoutes parts, http::Request request) {
  const auto id = reservation_id_of(request);
  if (!id) co_return http::problem(id.error());
  // SAFETY: it keeps others from commanding until it is cancelled by whom it belongs to, or by an administrator.
  const auto reservation = co_await parts.reservations.find(*id);
  if (!reservation) co_return http::problem(404, fmt::format("there is no reservation {}", *id), "no_such_reservation");
  const bool is_own = reservation->holder == parts.station.account_of(request.actor);
  if (!is_own && !is_admin(request)) {
    co_return http::problem(403, fmt::format("only {} or an administrator cancels it", reservation->holder),
                            "not_permitted", {{"needs", text(identity::Role::admin)}});
  }
  const auto cancelled = co_await parts.reservations.cancel(*id, author_of(request, parts.clock));
  if (!cancelled) co_return http::problem(cancelled.error());
  parts.station.remove_reservation(*id, request.actor);
  co_return http::json_response(200, live::to_json(*cancelled));
}

}  // namespace

void add_reservation_routes(http::Router& router, ReservationRoutes parts) {
  const auto add = [&router, parts](const char* method, const char* pattern, identity::Scope needs,
                                    std::vector<std::string> query,
                                    http::Answer (*answer)(ReservationRoutes, http::Request)) {
    router.add({method, pattern, needs, std::move(query), with(parts, answer)});
  };
  using identity::Scope;
  add("POST", "/api/v1/robots/{robot_id}/reservations", Scope::command, {}, make_reservation);
  add("GET", "/api/v1/reservations", Scope::read, {"robot_id", "over", "before", "limit"}, list_reservations);
  add("POST", "/api/v1/reservations/{reservation_id}/cancel", Scope::command, {}, cancel_reservation);
}

}  // namespace server::api
