// The output of a model from fixed rates agrees with other ways to compute it, and so do its derivatives.
#include "control/search/output_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "control/models/modal_form.hpp"

namespace control {
namespace {

using Eigen::Index;

// Steps the modal form of the model itself, whose rates are chosen for this model alone.
struct Stepped {
  Eigen::VectorXd position, velocity;
};

Stepped stepped(const FractionalModel& model, const std::vector<double>& duty, double dt_s, double delay_s = 0) {
  const double longest_s = dt_s * static_cast<double>(duty.size());
  const ModalForm form = modal_form(model, {dt_s, longest_s, 1e-14});
  const DelayedDuty input = delayed(duty, dt_s, delay_s);
  Stepped result{Eigen::VectorXd::Zero(input.integral.rows()), Eigen::VectorXd::Zero(input.integral.rows())};
  for (std::size_t i = 0; i < form.rate.size(); ++i) {
    const Complex s = form.rate[i], w = 2.0 * form.weight[i] / s;
    Complex v = 0, x = 0;
    for (Index k = 0; k + 1 < input.integral.rows(); ++k) {  // exact between changes of the duty
      const auto advance = [&](double u, double t_s) {
        const Complex z = s * t_s;
        const Complex e =
            std::abs(z) < 1e-3 ? z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0))) : std::exp(z) - 1.0;
        const Complex settled = -w * u, rest = v - settled;
        x += settled * t_s + rest * e / s;
        v = settled + rest * (1.0 + e);
      };
      advance(input.integral(k, 0), dt_s - input.lead_s);
      advance(input.integral(k, 0) + input.change[k], input.lead_s);
      result.velocity[k + 1] += v.real();
      result.position[k + 1] += x.real();
    }
  }
  return result;
}

double largest_share(const Eigen::VectorXd& found, const Eigen::VectorXd& expected) {
  return (found - expected).lpNorm<Eigen::Infinity>() / expected.lpNorm<Eigen::Infinity>();
}

std::vector<double> any_duty(std::size_t samples) {
  std::vector<double> duty(samples);
  for (std::size_t k = 0; k < samples; ++k)
    duty[k] = std::sin(0.07 * static_cast<double>(k)) + (k % 37 < 15 ? 0.5 : -0.3);
  return duty;
}

const std::vector<FractionalModel> kModels{kNonNewtonianModel,
                                           normalised(kNewtonianModel),
                                           {0.2, 0.02, 0.1, 1, 1.9, 0.9},  // lightly damped
                                           {0.2, 0.02, 0.02, 1, 2, 1},     // the same of integer orders
                                           {0.2, 1e-4, 0.3, 1, 1.1, 0.3},  // no pole
                                           {0.2, 0, 0.3, 1, 1.5, 1},       // first order
                                           {0.2, 0.5, 2, 1, 1.5, 0.5}};

TEST(OutputModel, AgreesWithTheModalFormOfEachModel) {
  const std::vector<double> duty = any_duty(401);
  const OutputModel position(Channel::position, 0.01, duty, 0, 1e-13),
      velocity(Channel::velocity, 0.01, duty, 0, 1e-13);
  for (const FractionalModel& model : kModels) {
    const Stepped expected = stepped(model, duty, 0.01);
    const double p = largest_share(position.output(model), expected.position);
    const double v = largest_share(velocity.output(model), expected.velocity);
    EXPECT_LT(p, 1e-11) << model.alpha << ' ' << model.beta;
    EXPECT_LT(v, 1e-11) << model.alpha << ' ' << model.beta;
  }
}

TEST(OutputModel, JacobianIsTheDerivative) {
  const std::vector<double> duty = any_duty(201);
  for (const Channel channel : {Channel::position, Channel::velocity}) {
    const OutputModel output(channel, 0.01, duty, 0, 1e-13);
    for (const FractionalModel& model : {kModels[0], kModels[2], kModels[4]}) {
      const Eigen::MatrixXd slopes = output.jacobian(model);
      for (Index q = 0; q < 5; ++q) {
        const auto moved = [&](double by) {
          FractionalModel m = model;
          (q == 0 ? m.kp : q == 1 ? m.b1 : m.b2) *= q < 3 ? std::exp(by) : 1;
          (q == 3 ? m.alpha : m.beta) += q < 3 ? 0 : by;
          return output.output(m);
        };
        const Eigen::VectorXd expected = (moved(1e-5) - moved(-1e-5)) / 2e-5;
        EXPECT_LT(largest_share(slopes.col(q), expected), 1e-6) << model.alpha << ' ' << q;
      }
    }
  }
}

TEST(OutputModel, DelaysTheDutyBetweenSamplesAndKnowsItsSlope) {
  const std::vector<double> duty = any_duty(201);
  for (const double delay_s : {0.0234, 0.0299}) {
    OutputModel position(Channel::position, 0.01, duty, 0.1, 1e-13);
    position.set_delay(delay_s);
    const Stepped expected = stepped(kNonNewtonianModel, duty, 0.01, delay_s);
    EXPECT_LT(largest_share(position.output(kNonNewtonianModel), expected.position), 1e-9);
    const Eigen::VectorXd slope = position.slope(kNonNewtonianModel);
    EXPECT_LT(largest_share(slope, expected.velocity), 1e-7);
    OutputModel velocity(Channel::velocity, 0.01, duty, 0.1, 1e-13);
    const auto delayed_by = [&](double by_s) {
      velocity.set_delay(delay_s + by_s);
      return velocity.output(kNonNewtonianModel);
    };
    const Eigen::VectorXd difference = (delayed_by(-1e-6) - delayed_by(1e-6)) / 2e-6;
    velocity.set_delay(delay_s);
    EXPECT_LT(largest_share(velocity.slope(kNonNewtonianModel), difference), 1e-3) << delay_s;
  }
}

}  // namespace
}  // namespace control
