// Controllers of the library and of the robot as bodies: the same coefficients on the wire, or a sentence that says
// what is wrong.
#include "server/api/bodies/controller_body.hpp"

#include <gtest/gtest.h>

#include <complex>

#include "control/discretisation/discretise.hpp"
#include "server/analysis/control_json.hpp"
#include "server/storage/samples/in_force_json.hpp"

namespace server {
namespace {

using nlohmann::json;

json discretised(control::DiscretisationMethod method) {
  control::DiscretisationOptions options;
  options.method = method;
  return json::parse(
      analysis::json_of(control::discretise(control::FopdController{65.0028, 0.0305, 0.6524}, options)).dump());
}

json body_of(json controller) { return {{"controller", std::move(controller)}, {"duty_min", -1}, {"duty_max", 1}}; }

Result<protocol::Controller> read(const json& body, const protocol::Controller* in_force = nullptr) {
  return controller_from(api::Members{body}, in_force);
}

// docs/protocol.md: u = direct · e + Σ residue_i · x_i + Σ biquads.
std::complex<double> response(const protocol::Controller& controller, double omega_rad_s) {
  const double period_s = controller.period_us * 1e-6;
  const std::complex<double> z = std::polar(1.0, omega_rad_s * period_s), w = 1.0 / z;
  std::complex<double> sum = controller.direct;
  for (pb_size_t i = 0; i < controller.pole_count; ++i) {
    sum += double{controller.residue[i]} / (z - double{controller.pole[i]});
  }
  for (pb_size_t j = 0; j < controller.biquad_b0_count; ++j) {
    sum += (double{controller.biquad_b0[j]} + double{controller.biquad_b1[j]} * w) * w /
           (1.0 + double{controller.biquad_a1[j]} * w + double{controller.biquad_a2[j]} * w * w);
  }
  return sum;
}

TEST(ControllerBody, WhatDiscretisePrintsHasTheSameResponseOnTheWire) {
  for (const auto method : {control::DiscretisationMethod::direct, control::DiscretisationMethod::oustaloup}) {
    control::DiscretisationOptions options;
    options.method = method;
    const auto made = control::discretise(control::FopdController{65.0028, 0.0305, 0.6524}, options);
    const auto controller = read(body_of(discretised(method)));
    ASSERT_TRUE(controller) << controller.error().detail;
    EXPECT_EQ(controller->period_us, 10'000U);
    EXPECT_EQ(controller->kp, 65.0028F);
    for (const double omega_rad_s : {0.1, 1.0, 6.0, 30.0, 200.0}) {
      const auto wanted = control::discrete_response(made.sections, 0.01, omega_rad_s);
      EXPECT_LT(std::abs(response(*controller, omega_rad_s) - wanted), 2e-5 * std::abs(wanted)) << omega_rad_s;
    }
  }
}

TEST(ControllerBody, ASecondOrderSectionBecomesABiquad) {
  const json given{{"period_s", 0.01},
                   {"dc_gain", 10},
                   {"sections",
                    {{"direct", 3},
                     {"first_order", json::array()},
                     {"second_order", {{{"b0", 2}, {"b1", -1}, {"a1", -1.5}, {"a2", 0.625}}}}}}};
  const auto controller = read(body_of(given));
  ASSERT_TRUE(controller) << controller.error().detail;
  EXPECT_EQ(controller->direct, 5.0F);
  EXPECT_EQ(controller->biquad_b0[0], 2.0F);
  EXPECT_EQ(controller->biquad_b1[0], -1.25F);
  const double omega_rad_s = 20;
  const std::complex<double> w = std::polar(1.0, -omega_rad_s * 0.01);
  const auto wanted = 3.0 + (2.0 - w) / (1.0 - 1.5 * w + 0.625 * w * w);
  EXPECT_LT(std::abs(response(*controller, omega_rad_s) - wanted), 1e-6);
}

// As in the golden frame `set_controller`, whose checksum the robot has checked.
TEST(ControllerBody, ComputesTheChecksumOfTheProtocolAndAnIdFromIt) {
  json given{{"period_us", 10'000},
             {"kp", 65.0028F},
             {"direct", 117.11186F},
             {"pole", {-0.4649264F, -0.1022562F, 0.4380344F, 0.8222267F, 0.970841F}},
             {"residue", {-29.9971855F, -14.5876807F, -5.3258752F, -1.0051928F, -0.0781306F}},
             {"duty_min", -1},
             {"duty_max", 1},
             {"derivative_on", "error"}};
  const auto controller = read({{"controller", given}});
  ASSERT_TRUE(controller) << controller.error().detail;
  EXPECT_EQ(controller->checksum, 3'099'722'980U);
  EXPECT_EQ(controller->controller_id, 3'099'722'980U & 0xFF'FFFFU);
  EXPECT_EQ(read({{"controller", given}, {"controller_id", 9}})->controller_id, 9U);

  const json reported = storage::controller_json(*controller);
  EXPECT_TRUE(station::is_same(*read({{"controller", reported}}), *controller))
      << "what the robot says can be sent back";
  json changed = reported;
  changed["kp"] = 60;
  EXPECT_EQ(read({{"controller", changed}}).error().reason, "checksum");
}

TEST(ControllerBody, TakesWhatIsLeftOutFromTheControllerInForce) {
  json given = discretised(control::DiscretisationMethod::direct);
  protocol::Controller in_force = rheonaut_Controller_init_zero;
  in_force.duty_min = -0.25F;
  in_force.duty_max = 0.75F;
  in_force.derivative_on = rheonaut_DERIVATIVE_ON_MEASUREMENT;
  EXPECT_EQ(read({{"controller", given}}).error().reason, "missing_member");
  auto controller = read({{"controller", given}}, &in_force);
  ASSERT_TRUE(controller);
  EXPECT_EQ(controller->duty_min, -0.25F);
  EXPECT_EQ(controller->duty_max, 0.75F);
  EXPECT_EQ(controller->derivative_on, rheonaut_DERIVATIVE_ON_MEASUREMENT);
  controller = read({{"controller", given}, {"duty_max", 0.5}, {"derivative_on", "error"}}, &in_force);
  EXPECT_EQ(controller->duty_max, 0.5F);
  EXPECT_EQ(controller->derivative_on, rheonaut_DERIVATIVE_ON_ERROR);
}

TEST(ControllerBody, RefusesWhatIsNone) {
  const json good = discretised(control::DiscretisationMethod::direct);
  const auto reason_of = [](const json& body) {
    const auto controller = read(body);
    return controller ? std::string{"none"} : controller.error().reason;
  };
  EXPECT_EQ(reason_of(body_of(good)), "none");
  EXPECT_EQ(reason_of(json::object()), "missing_member");
  EXPECT_EQ(reason_of(body_of("c.json")), "wrong_type");
  EXPECT_EQ(reason_of(body_of(json::object())), "missing_member");
  EXPECT_EQ(reason_of(body_of({{"speed", 1}})), "unknown_member");
  for (const auto& [path, value] :
       std::initializer_list<std::pair<const char*, json>>{{"/period_s", 0},
                                                           {"/period_s", 1e300},
                                                           {"/dc_gain", 1e300},
                                                           {"/sections/direct", "1"},
                                                           {"/sections/direct", 1e300},
                                                           {"/sections/first_order", 7},
                                                           {"/sections/first_order/0", 7},
                                                           {"/sections/first_order/0/pole", 1e200},
                                                           {"/sections/second_order", {{{"b0", 1}}}}}) {
    json wrong = good;
    wrong[json::json_pointer{path}] = value;
    EXPECT_NE(reason_of(body_of(wrong)), "none") << path << " = " << value;
  }
  json many = good;
  for (int i = 0; i < 6; ++i) many["sections"]["first_order"].push_back(many["sections"]["first_order"][0]);
  EXPECT_EQ(reason_of(body_of(many)), "out_of_range");
  json body = body_of(good);
  body["derivative_on"] = "setpoint";
  EXPECT_EQ(reason_of(body), "out_of_range");
}

}  // namespace
}  // namespace server
