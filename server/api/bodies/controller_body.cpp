// Sections of the library become sections of the robot; what is missing is filled in.
#include "server/api/bodies/controller_body.hpp"

#include <fmt/format.h>

#include <bit>
#include <boost/crc.hpp>
#include <cmath>
#include <limits>

#include "server/api/bodies/limits.hpp"

namespace server::api {
namespace {

using nlohmann::json;

constexpr std::uint32_t kIdBits = 0xFF'FFFF;  // a float holds it, as the event controller_changed says it
constexpr std::uint32_t kBuiltInId = 1;

// The words of a list: a section or a number each.
Result<json> list_of(const Members& object, const char* name) {
  if (!object.has(name)) return json::array();
  const json& list = object.object().at(name);
  if (list.is_array()) return list;
  return fail(ErrorCode::bad_request, fmt::format("{} is not a list", name), "wrong_type");
}

Result<void> to_float(const char* name, double value, float& into) {
  if (!(std::abs(value) <= std::numeric_limits<float>::max())) {
    return fail(ErrorCode::invalid, fmt::format("{} = {} is no float", name, value), "out_of_range");
  }
  into = static_cast<float>(value);
  return {};
}

template <std::size_t size>
Result<void> append(float (&into)[size], pb_size_t& count, const char* name, double value) {
  if (count >= size) {
    return fail(ErrorCode::invalid, fmt::format("{} has more than {} entries", name, size), "out_of_range");
  }
  return to_float(name, value, into[count++]);
}

template <std::size_t size>
Result<void> read_list(const Members& object, const char* name, float (&into)[size], pb_size_t& count) {
  const auto list = list_of(object, name);
  if (!list) return std::unexpected{list.error()};
  for (const json& value : *list) {
    if (!value.is_number()) {
      return fail(ErrorCode::bad_request, fmt::format("an entry of {} is not a number", name), "wrong_type");
    }
    if (auto added = append(into, count, name, value.get<double>()); !added) return added;
  }
  return {};
}

Result<void> read_float(const Members& object, const char* name, float& into) {
  const auto value = object.number_as_float(name);
  if (!value) return std::unexpected{value.error()};
  into = *value;
  return {};
}

// r/(1 - p z^-1) = r + r p/(z - p)
Result<void> add_first_order(const json& section, double& direct, protocol::Controller& out) {
  if (!section.is_object()) return fail(ErrorCode::bad_request, "a section is not an object", "wrong_type");
  const Members members{section};
  const auto pole = members.number("pole"), residue = members.number("residue");
  if (!pole) return std::unexpected{pole.error()};
  if (!residue) return std::unexpected{residue.error()};
  direct += *residue;
  if (auto added = append(out.pole, out.pole_count, "first_order", *pole); !added) return added;
  return append(out.residue, out.residue_count, "first_order", *residue * *pole);
}

// (b0 + b1 w)/(1 + a1 w + a2 w²) = b0 + ((b1 - b0 a1) - b0 a2 w) w/(1 + a1 w + a2 w²), w = z^-1
Result<void> add_second_order(const json& section, double& direct, protocol::Controller& out) {
  if (!section.is_object()) return fail(ErrorCode::bad_request, "a section is not an object", "wrong_type");
  const Members members{section};
  double b0 = 0, b1 = 0, a1 = 0, a2 = 0;
  for (const auto& [name, into] : {std::pair{"b0", &b0}, {"b1", &b1}, {"a1", &a1}, {"a2", &a2}}) {
    const auto value = members.number(name);
    if (!value) return std::unexpected{value.error()};
    *into = *value;
  }
  direct += b0;
  constexpr auto kName = "second_order";
  if (auto added = append(out.biquad_b0, out.biquad_b0_count, kName, b1 - b0 * a1); !added) return added;
  if (auto added = append(out.biquad_b1, out.biquad_b1_count, kName, -b0 * a2); !added) return added;
  if (auto added = append(out.biquad_a1, out.biquad_a1_count, kName, a1); !added) return added;
  return append(out.biquad_a2, out.biquad_a2_count, kName, a2);
}

// Reads only the members that the robot needs; the rest of what `rheonaut discretise --json` prints explains it to
// people.
Result<void> read_sections(const Members& given, protocol::Controller& out) {
  constexpr double kUsPerS = 1e6;
  constexpr Range<double> kPeriods_s = numbers("DiscretisedController.period_s");
  const auto period_s = given.number("period_s");
  if (!period_s) return std::unexpected{period_s.error()};
  if (!(*period_s > kPeriods_s.minimum && *period_s <= kPeriods_s.maximum)) {
    return fail(ErrorCode::invalid,
                fmt::format("period_s = {} is outside {} to {}", *period_s, kPeriods_s.minimum, kPeriods_s.maximum),
                "out_of_range");
  }
  out.period_us = static_cast<std::uint32_t>(std::lround(*period_s * kUsPerS));
  if (auto gain = read_float(given, "dc_gain", out.kp); !gain) return gain;
  const json& object = given.object().at("sections");
  if (!object.is_object()) return fail(ErrorCode::bad_request, "sections is not an object", "wrong_type");
  const Members sections{object};
  auto direct = sections.number("direct");
  if (!direct) return std::unexpected{direct.error()};
  const auto first_order = list_of(sections, "first_order"), second_order = list_of(sections, "second_order");
  if (!first_order) return std::unexpected{first_order.error()};
  if (!second_order) return std::unexpected{second_order.error()};
  for (const json& section : *first_order) {
    if (auto added = add_first_order(section, *direct, out); !added) return added;
  }
  for (const json& section : *second_order) {
    if (auto added = add_second_order(section, *direct, out); !added) return added;
  }
  return to_float("direct", *direct, out.direct);
}

// As the robot says it: controller_json().
Result<void> read_coefficients(const Members& given, protocol::Controller& out) {
  auto known = given.only({"controller_id", "checksum", "period_us", "kp", "direct", "pole", "residue", "biquad_b0",
                           "biquad_b1", "biquad_a1", "biquad_a2", "duty_min", "duty_max", "derivative_on"});
  if (!known) return known;
  const auto period_us = given.integer("period_us", integers("Controller.period_us"));
  if (!period_us) return std::unexpected{period_us.error()};
  out.period_us = static_cast<std::uint32_t>(*period_us);
  if (auto read = read_float(given, "kp", out.kp); !read) return read;
  if (auto read = read_float(given, "direct", out.direct); !read) return read;
  if (auto read = read_list(given, "pole", out.pole, out.pole_count); !read) return read;
  if (auto read = read_list(given, "residue", out.residue, out.residue_count); !read) return read;
  if (auto read = read_list(given, "biquad_b0", out.biquad_b0, out.biquad_b0_count); !read) return read;
  if (auto read = read_list(given, "biquad_b1", out.biquad_b1, out.biquad_b1_count); !read) return read;
  if (auto read = read_list(given, "biquad_a1", out.biquad_a1, out.biquad_a1_count); !read) return read;
  return read_list(given, "biquad_a2", out.biquad_a2, out.biquad_a2_count);
}

Result<void> read_duty(const Members& body, const Members& given, const char* name, const float* in_force,
                       float& into) {
  if (body.has(name)) return read_float(body, name, into);
  if (given.has(name) || in_force == nullptr) return read_float(given, name, into);
  into = *in_force;
  return {};
}

Result<void> read_derivative(const Members& body, const Members& given, const protocol::Controller* in_force,
                             protocol::Controller& out) {
  const Members& of = body.has("derivative_on") ? body : given;
  if (!of.has("derivative_on")) {
    out.derivative_on = in_force == nullptr ? rheonaut_DERIVATIVE_ON_ERROR : in_force->derivative_on;
    return {};
  }
  const auto text = of.text("derivative_on", {0, 40});
  if (!text) return std::unexpected{text.error()};
  out.derivative_on = *text == "measurement" ? rheonaut_DERIVATIVE_ON_MEASUREMENT : rheonaut_DERIVATIVE_ON_ERROR;
  if (*text == "measurement" || *text == "error") return {};
  return fail(ErrorCode::invalid, fmt::format("derivative_on = '{}' is neither error nor measurement", *text),
              "out_of_range");
}

Result<void> read_identity(const Members& body, const Members& given, protocol::Controller& out) {
  out.checksum = checksum_of(out);
  if (given.has("checksum") && !given.has("sections")) {
    const auto checksum = given.integer("checksum", integers("Controller.checksum"));
    if (!checksum) return std::unexpected{checksum.error()};
    if (static_cast<std::uint32_t>(*checksum) != out.checksum) {
      return fail(
          ErrorCode::invalid,
          fmt::format("checksum = {} is not that of these coefficients, {}; leave it out when they were changed",
                      *checksum, out.checksum),
          "checksum");
    }
  }
  const bool is_of_body = body.has("controller_id");
  const Members& of = is_of_body ? body : given;
  if (of.has("controller_id")) {
    const auto id = of.integer("controller_id", is_of_body ? integers("SetControllerBody.controller_id")
                                                           : integers("Controller.controller_id"));
    if (!id) return std::unexpected{id.error()};
    out.controller_id = static_cast<std::uint32_t>(*id);
    return {};
  }
  out.controller_id = std::max(out.checksum & kIdBits, kBuiltInId + 1);
  return {};
}

}  // namespace

std::uint32_t checksum_of(const protocol::Controller& controller) {
  boost::crc_32_type crc;
  const auto add_word = [&crc](std::uint32_t word) {
    for (unsigned shift = 0; shift < 32; shift += 8) crc.process_byte(static_cast<unsigned char>(word >> shift));
  };
  const auto add = [&add_word](const float* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) add_word(std::bit_cast<std::uint32_t>(values[i]));
  };
  add_word(controller.period_us);
  add(&controller.kp, 1);
  add(&controller.direct, 1);
  add(controller.pole, controller.pole_count);
  add(controller.residue, controller.residue_count);
  add(controller.biquad_b0, controller.biquad_b0_count);
  add(controller.biquad_b1, controller.biquad_b1_count);
  add(controller.biquad_a1, controller.biquad_a1_count);
  add(controller.biquad_a2, controller.biquad_a2_count);
  add(&controller.duty_min, 1);
  add(&controller.duty_max, 1);
  add_word(static_cast<std::uint32_t>(controller.derivative_on));
  return crc.checksum();
}

Result<protocol::Controller> controller_from(const Members& body, const protocol::Controller* in_force) {
  if (!body.has("controller")) return fail(ErrorCode::bad_request, "controller is missing", "missing_member");
  if (!body.object().at("controller").is_object()) {
    return fail(ErrorCode::bad_request, "controller is not an object: send what rheonaut discretise --json prints",
                "wrong_type");
  }
  const Members given{body.object().at("controller")};
  protocol::Controller out = rheonaut_Controller_init_zero;
  auto read = given.has("sections") ? read_sections(given, out) : read_coefficients(given, out);
  if (read)
    read = read_duty(body, given, "duty_min", in_force == nullptr ? nullptr : &in_force->duty_min, out.duty_min);
  if (read)
    read = read_duty(body, given, "duty_max", in_force == nullptr ? nullptr : &in_force->duty_max, out.duty_max);
  if (read) read = read_derivative(body, given, in_force, out);
  if (read) read = read_identity(body, given, out);
  if (!read) return std::unexpected{read.error()};
  return out;
}

}  // namespace server::api
