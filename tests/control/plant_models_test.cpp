// The hydrodynamic model meets the one that the paper prints, where it can.
#include "control/models/plant_models.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

namespace control {
namespace {

using testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();

// Expects a refusal whose message has the name and the value.
template <class Call>
void expect_refusal(const Call& call, const std::string& name, const std::string& value) {
  try {
    call();
    ADD_FAILURE() << name << " = " << value << " was accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr(name));
    EXPECT_THAT(error.what(), HasSubstr(value));
  }
}

TEST(HydrodynamicModel, OfTable1IsTheNewtonianModelWithin02Percent) {
  const HydrodynamicModel result = hydrodynamic_model({});
  EXPECT_NEAR(result.model.b2, 60.1099, 5e-5);
  EXPECT_NEAR(result.model.b3, 666.153, 5e-4);
  EXPECT_NEAR(result.model.b2 / kNewtonianModel.b2, 1, 0.002);
  EXPECT_NEAR(result.model.b3 / kNewtonianModel.b3, 1, 0.002);
  EXPECT_EQ(result.model.b1, 1);
  EXPECT_EQ(result.model.alpha, 2);
  EXPECT_EQ(result.model.beta, 1);
  EXPECT_NEAR(result.total_mass_kg, 1.47984, 5e-6);
  EXPECT_NEAR(result.damping_kg_s, 21.6876, 5e-5);
  EXPECT_NEAR(result.linear_drag_kg_s, 1.9716, 5e-5);
  EXPECT_NEAR(result.quadratic_drag_kg_m, 9.858, 5e-4);
}

TEST(HydrodynamicModel, ShowsItsDerivedNumeratorBesideThePapers232) {
  const HydrodynamicModel result = hydrodynamic_model({});
  EXPECT_EQ(result.model.kp, 232);
  EXPECT_NEAR(result.derived_numerator, 3.5554, 5e-5);
}

TEST(HydrodynamicModel, MeetsThePapersDigitsWithAnAreaInsideItsRounding) {
  HydrodynamicParameters parameters;
  parameters.frontal_area_m2 = 0.031044;
  const FractionalModel model = hydrodynamic_model(parameters).model;
  EXPECT_NEAR(model.b2, 60.13, 5e-3);
  EXPECT_NEAR(model.b3, 667.1, 5e-2);
}

TEST(HydrodynamicModel, RefusesEveryBadParameterByItsName) {
  using P = HydrodynamicParameters;
  const std::pair<const char*, double P::*> positive[] = {{"thrust_coefficient", &P::thrust_coefficient},
                                                          {"drag_coefficient", &P::drag_coefficient},
                                                          {"propeller_diameter_m", &P::propeller_diameter_m},
                                                          {"propeller_radius_m", &P::propeller_radius_m},
                                                          {"blade_area_m2", &P::blade_area_m2},
                                                          {"fluid_density_kg_m3", &P::fluid_density_kg_m3},
                                                          {"frontal_area_m2", &P::frontal_area_m2},
                                                          {"mass_kg", &P::mass_kg},
                                                          {"operating_velocity_m_s", &P::operating_velocity_m_s},
                                                          {"numerator", &P::numerator}};
  const std::pair<const char*, double P::*> not_negative[] = {{"added_mass_coefficient", &P::added_mass_coefficient},
                                                              {"flow_velocity_m_s", &P::flow_velocity_m_s}};
  const auto expect = [](const char* name, double P::* member, double value, const char* text) {
    HydrodynamicParameters parameters;
    parameters.*member = value;
    expect_refusal([&] { hydrodynamic_model(parameters); }, name, text);
  };
  for (const auto& [name, member] : positive) expect(name, member, 0, "0");
  for (const auto& list : {std::span<const std::pair<const char*, double P::*>>{positive}, {not_negative}}) {
    for (const auto& [name, member] : list) {
      expect(name, member, -0.25, "-0.25");
      expect(name, member, kNan, "nan");
      expect(name, member, kInfinity, "inf");
    }
  }
}

TEST(HydrodynamicModel, RefusesABadMotorByItsName) {
  for (const auto& [value, text] : {std::pair{0.0, "0"}, {-0.25, "-0.25"}, {kNan, "nan"}}) {
    HydrodynamicParameters parameters;
    parameters.motor = {value, 0.022};
    expect_refusal([&] { hydrodynamic_model(parameters); }, "gain_rad_s", text);
    parameters.motor = {700, value};
    expect_refusal([&] { hydrodynamic_model(parameters); }, "time_constant_s", text);
  }
}

TEST(FractionalModel, OfThePaperIsAccepted) {
  EXPECT_NO_THROW(check(kNonNewtonianModel));
  EXPECT_NO_THROW(check(kNewtonianModel));
  EXPECT_NO_THROW(check(FractionalModel{2, 0, 0.5, 1, 1.5, 1}));  // a first-order lag
  EXPECT_NO_THROW(check(MotorModel{}));
}

TEST(FractionalModel, RefusesEveryBadParameterByItsName) {
  using M = FractionalModel;
  const std::tuple<const char*, double M::*, double, const char*> bad[] = {
      {"kp", &M::kp, 0, "0"},           {"kp", &M::kp, kNan, "nan"},      {"b1", &M::b1, -1, "-1"},
      {"b1", &M::b1, kNan, "nan"},      {"b2", &M::b2, 0, "0"},           {"b2", &M::b2, kInfinity, "inf"},
      {"b3", &M::b3, -1, "-1"},         {"b3", &M::b3, kNan, "nan"},      {"beta", &M::beta, 0, "0"},
      {"beta", &M::beta, 1.5, "1.5"},   {"beta", &M::beta, kNan, "nan"},  {"alpha", &M::alpha, 0.5, "0.5"},
      {"alpha", &M::alpha, 2.5, "2.5"}, {"alpha", &M::alpha, kNan, "nan"}};
  for (const auto& [name, member, value, text] : bad) {
    FractionalModel model = kNonNewtonianModel;
    model.*member = value;
    expect_refusal([&] { check(model); }, name, text);
  }
}

TEST(FractionalModel, NormalisedHasB3OfOneAndTheSameGain) {
  const FractionalModel model = normalised(kNewtonianModel);
  EXPECT_EQ(model.b3, 1);
  EXPECT_NEAR(model.kp, 0.347774, 5e-7);
  EXPECT_NEAR(model.b1, 1 / 667.1, 1e-15);
  EXPECT_NEAR(model.b2, 60.13 / 667.1, 1e-15);
  EXPECT_EQ(model.alpha, 2);
  EXPECT_EQ(model.beta, 1);
}

}  // namespace
}  // namespace control
