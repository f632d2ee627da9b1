// Evaluates, splits and runs discrete transfer functions.
#include "control/responses/sections.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <stdexcept>

#include "base/invalid_argument.hpp"
#include "control/responses/polynomial_roots.hpp"

namespace control {
namespace {

constexpr double kNearZeroPole = 1e-3;  // below it a pole shares a section with the direct term
constexpr double kSamePole = 1e-9;      // relative distance of poles that count as one

void check(const DiscreteTransferFunction& transfer) {
  const auto &b = transfer.numerator, &a = transfer.denominator;
  if (a.empty() || a.size() != b.size()) {
    base::throw_invalid("sections: ", "numerator and denominator must have the same length, have ", b.size(), " and ",
                        a.size(), "; fill the shorter up with zeros");
  }
  if (a[0] != 1) base::throw_invalid("sections: ", "denominator must begin with 1, begins with ", a[0]);
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (std::isfinite(a[k]) && std::isfinite(b[k])) continue;
    base::throw_invalid("sections: ", "coefficient ", k, " is not finite (", b[k], ", ", a[k], ")");
  }
  if (!(transfer.period_s > 0 && std::isfinite(transfer.period_s))) {
    base::throw_invalid("sections: ", "period_s must be positive, is ", transfer.period_s);
  }
}

std::vector<Complex> eigenvalues(const Eigen::MatrixXd& matrix) {
  if (matrix.size() == 0) return {};
  const Eigen::VectorXcd values = matrix.eigenvalues();
  return {values.begin(), values.end()};
}

// Σ c_k x^(n-k)
Complex horner(const std::vector<double>& c, Complex x) {
  Complex sum = 0;
  for (const double value : c) sum = sum * x + value;
  return sum;
}

using LongPolynomial = std::vector<long double>;  // ascending powers of 1/z

LongPolynomial product(const LongPolynomial& left, const LongPolynomial& right) {
  LongPolynomial result(left.size() + right.size() - 1, 0);
  for (std::size_t i = 0; i < left.size(); ++i) {
    for (std::size_t j = 0; j < right.size(); ++j) result[i + j] += left[i] * right[j];
  }
  return result;
}

Complex at(const ParallelSections& sections, Complex delay) {
  Complex sum = sections.direct;
  for (const auto& s : sections.first_order) sum += s.residue / (1.0 - s.pole * delay);
  for (const auto& s : sections.second_order) {
    sum += (s.b0 + s.b1 * delay) / (1.0 + s.a1 * delay + s.a2 * delay * delay);
  }
  return sum;
}

std::pair<Complex, Complex> pole_pair(const SecondOrderSection& section) {
  const Complex root = std::sqrt(Complex(section.a1 * section.a1 / 4 - section.a2));
  const Complex larger = section.a1 > 0 ? -section.a1 / 2 - root : -section.a1 / 2 + root;
  return {larger, larger == 0.0 ? 0.0 : section.a2 / larger};
}

std::string find_fault(const std::vector<Complex>& pole) {
  for (std::size_t i = 0; i < pole.size(); ++i) {
    if (!(std::abs(pole[i]) < 1)) {
      return base::join_text("sections: pole ", pole[i].real(), " + ", pole[i].imag(),
                             "i is not inside the unit circle; fit again");
    }
    for (std::size_t j = 0; j < i; ++j) {
      const double distance = std::abs(pole[i] - pole[j]);
      const bool both_near_zero = std::abs(pole[i]) < kNearZeroPole && std::abs(pole[j]) < kNearZeroPole;
      if (distance > kSamePole * std::abs(pole[i]) && !both_near_zero) continue;
      return base::join_text("sections: poles ", pole[j].real(), " and ", pole[i].real(),
                             " coincide; take a lower order");
    }
  }
  return "";
}

// One sample through (2), in the arithmetic of Real.
template <class Real>
Real run(const ParallelSections& sections, std::vector<Real>& first, std::vector<Real>& second, Real error) {
  Real output = static_cast<Real>(sections.direct) * error;
  for (std::size_t i = 0; i < sections.first_order.size(); ++i) {
    const auto& s = sections.first_order[i];
    first[i] = static_cast<Real>(s.residue) * error + static_cast<Real>(s.pole) * first[i];
    output += first[i];
  }
  for (std::size_t j = 0; j < sections.second_order.size(); ++j) {
    const auto& s = sections.second_order[j];
    Real &last = second[2 * j], &last_but_one = second[2 * j + 1];
    const Real state = error - static_cast<Real>(s.a1) * last - static_cast<Real>(s.a2) * last_but_one;
    output += static_cast<Real>(s.b0) * state + static_cast<Real>(s.b1) * last;
    last_but_one = last;
    last = state;
  }
  return output;
}

}  // namespace

Complex discrete_response(const DiscreteTransferFunction& transfer, double omega_rad_s) {
  check(transfer);
  const Complex z = std::polar(1.0, omega_rad_s * transfer.period_s);
  return horner(transfer.numerator, z) / horner(transfer.denominator, z);
}

double dc_gain(const DiscreteTransferFunction& transfer) {
  check(transfer);
  return (horner(transfer.numerator, 1) / horner(transfer.denominator, 1)).real();
}

std::vector<Complex> poles(const DiscreteTransferFunction& transfer) {
  check(transfer);
  return polynomial_roots(transfer.denominator);
}

std::vector<Complex> zeros(const DiscreteTransferFunction& transfer) {
  check(transfer);
  std::vector<double> numerator = transfer.numerator;
  while (!numerator.empty() && numerator.front() == 0) numerator.erase(numerator.begin());
  if (numerator.empty()) return {};
  return polynomial_roots(numerator);
}

Complex discrete_response(const ParallelSections& sections, double period_s, double omega_rad_s) {
  return at(sections, std::polar(1.0, -omega_rad_s * period_s));
}

double dc_gain(const ParallelSections& sections) { return at(sections, 1).real(); }

std::vector<Complex> poles(const ParallelSections& sections) {
  std::vector<Complex> result;
  for (const auto& s : sections.first_order) result.emplace_back(s.pole);
  for (const auto& s : sections.second_order) {
    const auto [larger, smaller] = pole_pair(s);
    result.push_back(larger);
    if (s.a2 != 0) result.push_back(smaller);
  }
  return result;
}

// Eigenvalues of A - B C/D of the sections as a state-space model: with the input that keeps the output at 0.
std::vector<Complex> zeros(const ParallelSections& sections) {
  const std::size_t first = sections.first_order.size(), second = sections.second_order.size();
  const auto n = static_cast<Eigen::Index>(first + 2 * second);
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(n), c = Eigen::VectorXd::Zero(n);
  double through = sections.direct;
  Eigen::Index i = 0;
  for (const auto& s : sections.first_order) {
    a(i, i) = s.pole;
    b(i) = 1;
    c(i) = s.residue * s.pole;
    through += s.residue;
    ++i;
  }
  for (const auto& s : sections.second_order) {
    a(i, i) = -s.a1;
    a(i, i + 1) = -s.a2;
    a(i + 1, i) = 1;
    b(i) = 1;
    c(i) = s.b1 - s.b0 * s.a1;
    c(i + 1) = -s.b0 * s.a2;
    through += s.b0;
    i += 2;
  }
  if (through == 0)
    base::throw_invalid("sections: ", "the first sample of the impulse response is 0: zeros at infinity");
  return eigenvalues(a - b * c.transpose() / through);
}

double white_noise_gain(const ParallelSections& sections) {
  double first_sample = sections.direct;
  std::vector<std::pair<Complex, Complex>> terms;  // g, p of (4)
  for (const auto& s : sections.first_order) {
    first_sample += s.residue;
    terms.emplace_back(s.residue * s.pole, s.pole);
  }
  for (const auto& s : sections.second_order) {
    first_sample += s.b0;
    const auto [p, q] = pole_pair(s);
    if (s.a2 == 0) {
      terms.emplace_back(s.b0 * p + s.b1, p);
    } else {
      terms.emplace_back((s.b0 * p + s.b1) * p / (p - q), p);
      terms.emplace_back((s.b0 * q + s.b1) * q / (q - p), q);
    }
  }
  Complex sum = first_sample * first_sample;
  for (const auto& [g, p] : terms) {
    for (const auto& [other_g, other_p] : terms) sum += g * other_g / (1.0 - p * other_p);
  }
  return std::sqrt(std::max(0.0, sum.real()));
}

std::expected<ParallelSections, std::string> partial_fractions(const DiscreteTransferFunction& transfer) {
  check(transfer);
  std::vector<double> b = transfer.numerator, a = transfer.denominator;
  while (a.size() > 1 && a.back() == 0 && b.back() == 0) {
    a.pop_back();
    b.pop_back();
  }
  const std::vector<Complex> pole = polynomial_roots(a);
  if (std::string fault = find_fault(pole); !fault.empty()) return std::unexpected(std::move(fault));
  ParallelSections sections;
  double remaining_first_sample = b[0], near_zero_pole = 1;
  Complex others = 1;  // product of the negated poles that are not near 0
  for (const Complex p : pole) {
    if (std::abs(p) < kNearZeroPole) {
      near_zero_pole = p.real();
      continue;
    }
    others *= -p;
    Complex residue = horner(b, p) / p;  // (3)
    for (const Complex other : pole) residue /= other == p ? 1.0 : p - other;
    if (p.imag() < 0) continue;
    if (p.imag() == 0) {
      sections.first_order.push_back({p.real(), residue.real()});
      remaining_first_sample -= residue.real();
    } else {
      sections.second_order.push_back(
          {2 * residue.real(), -2 * (residue * std::conj(p)).real(), -2 * p.real(), std::norm(p)});
      remaining_first_sample -= 2 * residue.real();
    }
  }
  if (near_zero_pole == 1) {
    sections.direct = b.back() / a.back();
  } else {
    sections.second_order.push_back({remaining_first_sample, b.back() / others.real(), -near_zero_pole, 0});
  }
  return sections;
}

ParallelSections to_parallel_sections(const DiscreteTransferFunction& transfer) {
  auto sections = partial_fractions(transfer);
  if (!sections) throw std::invalid_argument(sections.error());
  return *std::move(sections);
}

DiscreteTransferFunction to_transfer_function(const ParallelSections& sections, double period_s) {
  LongPolynomial numerator{sections.direct}, denominator{1};
  const auto add = [&](const LongPolynomial& b, const LongPolynomial& a) {
    const LongPolynomial left = product(numerator, a), right = product(b, denominator);
    numerator.assign(std::max(left.size(), right.size()), 0);
    for (std::size_t k = 0; k < left.size(); ++k) numerator[k] += left[k];
    for (std::size_t k = 0; k < right.size(); ++k) numerator[k] += right[k];
    denominator = product(denominator, a);
  };
  for (const auto& s : sections.first_order) add({s.residue}, {1, -s.pole});
  for (const auto& s : sections.second_order) {
    add({s.b0, s.b1}, s.a2 == 0 ? LongPolynomial{1, s.a1} : LongPolynomial{1, s.a1, s.a2});
  }
  const auto rounded = [](const LongPolynomial& c) { return std::vector<double>(c.begin(), c.end()); };
  return {rounded(numerator), rounded(denominator), period_s};
}

void add_first_order(ParallelSections& sections, double b0, double b1, double pole) {
  if (std::abs(pole) < kNearZeroPole) {
    sections.second_order.push_back({b0, b1, -pole, 0});
  } else {
    sections.direct -= b1 / pole;
    sections.first_order.push_back({pole, b0 + b1 / pole});
  }
}

SectionFilter::SectionFilter(ParallelSections sections)
    : sections_(std::move(sections)),
      first_order_state_(sections_.first_order.size(), 0),
      second_order_state_(2 * sections_.second_order.size(), 0) {}

double SectionFilter::step(double error) { return run(sections_, first_order_state_, second_order_state_, error); }

void SectionFilter::reset() {
  first_order_state_.assign(first_order_state_.size(), 0);
  second_order_state_.assign(second_order_state_.size(), 0);
}

double float32_rms_error(const ParallelSections& sections, std::span<const double> error_m) {
  if (error_m.empty()) base::throw_invalid("sections: ", "no error signal to compare float32 and double on");
  std::vector<float> first(sections.first_order.size()), second(2 * sections.second_order.size());
  SectionFilter exact{sections};
  double sum = 0;
  for (const double error : error_m) {
    // The robot forms the error in float, so that rounding is not the sections' own.
    const auto rounded = static_cast<float>(error);
    const double difference = static_cast<double>(run(sections, first, second, rounded)) - exact.step(rounded);
    sum += difference * difference;
  }
  return std::sqrt(sum / static_cast<double>(error_m.size()));
}

}  // namespace control
