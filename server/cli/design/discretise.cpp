// `rheonaut discretise`.
#include "server/cli/design/discretise.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "control/discretisation/accuracy_doubt.hpp"
#include "server/analysis/control_json.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

using control::Discretisation;
using control::DiscretisationMethod;

using control::CodeLanguage;

const char* yes_no(bool value) { return value ? "yes" : "no"; }

std::string name_of(const Discretisation& d) {
  if (d.options.method == DiscretisationMethod::direct) return fmt::format("direct, a = {}", d.options.a);
  return text(d.options.method);
}

void write_compared(std::ostream& out, std::span<const Discretisation> compared) {
  const auto& band = compared.front().errors;
  fmt::print(out, "errors against C(jw): from {:.3g} to {:.4g} rad/s, and below {:.3g} rad/s\n", band.band_low_rad_s,
             band.band_high_rad_s, band.bandwidth_rad_s);
  Table table{{"method", "max (dB)", "max (deg)", "rms (%)", "in band (%)", "in band (deg)", "fit (%)", "stable",
               "min. phase", "noise gain (1/m)", "float32 (duty rms)"}};
  for (const Discretisation& d : compared) {
    const auto& e = d.errors;
    table.row({name_of(d), cell(e.max_db, 3), cell(e.max_deg, 3), cell(100 * e.rms_relative, 3),
               cell(100 * e.max_relative_in_bandwidth, 3), cell(e.max_deg_in_bandwidth, 3),
               cell(100 * e.fit_max_relative, 3), yes_no(d.is_stable), yes_no(d.is_minimum_phase),
               cell(d.noise_gain, 4), cell(d.float32_rms_duty, 2)});
  }
  table.write(out);
}

void write_coefficients(std::ostream& out, const Discretisation& d) {
  if (d.transfer) {
    const auto& [numerator, denominator, period_s] = *d.transfer;
    Table coefficients{{"power of 1/z", "numerator", "denominator"}};
    for (std::size_t i = 0; i < numerator.size(); ++i) {
      coefficients.row({fmt::format("{}", i), cell(numerator[i], 12), cell(denominator[i], 12)});
    }
    coefficients.write(out);
  } else {
    fmt::print(out, "{}\n", d.transfer_note);
  }
  out << '\n';
  Table sections{{"section", "pole or a1", "a2", "residue or b0", "b1"}};
  sections.row({"direct", "-", "-", cell(d.sections.direct, 12), "-"});
  for (const auto& s : d.sections.first_order) {
    sections.row({"first order", cell(s.pole, 12), "-", cell(s.residue, 12), "-"});
  }
  for (const auto& s : d.sections.second_order) {
    sections.row({"second order", cell(s.a1, 12), cell(s.a2, 12), cell(s.b0, 12), cell(s.b1, 12)});
  }
  sections.write(out);
}

}  // namespace

void add_options(CLI::App& command, Sampling& sampling) {
  command.add_option("--period-s", sampling.period_s, "Sampling period (default: 0.01)")->check(positive());
  command
      .add_option("--order", sampling.order,
                  fmt::format("Order of the transfer function, 1 to {} (default: 5)", control::kLargestOrder))
      ->check(whole(1, control::kLargestOrder));
  add_word(command, "--method", sampling.method,
           std::array{DiscretisationMethod::direct, DiscretisationMethod::oustaloup},
           "direct or oustaloup (default: several are tried, the choice is explained)");
  command
      .add_option("--a", sampling.a,
                  "Of the direct method: 0 is Euler, 1 Tustin (0.5 if only --method is given); implies --method direct")
      ->check(from_to(0, 1));
  command
      .add_option("--bandwidth-rad-s", sampling.bandwidth_rad_s, "Of the loop: accuracy matters below it (default: 30)")
      ->check(positive());
}

void add_options(CLI::App& command, Discretise& options) {
  add_option(command, options.controller);
  add_options(command, options.sampling);
  add_word(command, "--code", options.code, std::array{CodeLanguage::c, CodeLanguage::matlab},
           "Print the controller as source text instead: c or matlab");
  add_json_flag(command, options.form);
  command.get_option("--code")->excludes("--json");
  command.footer("Example: rheonaut discretise --period-s 0.01 --order 5 --method direct --a 0.5");
}

int run(const Discretise& options, std::ostream& out) {
  const control::FopdController controller = read(options.controller);
  const control::DiscretisationChoice choice = discretised(controller, options.sampling);
  const std::string doubt = control::accuracy_doubt(choice.chosen);
  if (options.code) {
    out << control::controller_code(*options.code, controller, choice.chosen);
    if (!doubt.empty()) fmt::print(stderr, "rheonaut: warning: {}\n", doubt);
    return 0;
  }
  if (options.form.is_json) {
    analysis::OrderedJson answer = analysis::json_of(choice.chosen);
    answer["reason"] = choice.reason;
    answer["compared"] = analysis::OrderedJson::array();
    for (const Discretisation& other : choice.compared) answer["compared"].push_back(analysis::json_of(other));
    answer["refused"] = analysis::OrderedJson::array();
    for (const auto& [name, reason] : choice.refused) answer["refused"].push_back({{"name", name}, {"reason", reason}});
    answer["controller"] = analysis::json_of(controller);
    answer["warnings"] = doubt.empty() ? std::vector<std::string>{} : std::vector{doubt};
    write_json(out, answer);
    return 0;
  }
  fmt::print(out, "{}, order {}, {} s: {}\nDC gain {:.9g} (before its correction {:.9g})\n\n", name_of(choice.chosen),
             choice.chosen.options.order, choice.chosen.options.period_s, choice.reason, choice.chosen.dc_gain,
             choice.chosen.dc_gain_before);
  write_compared(out, choice.compared);
  for (const auto& [name, reason] : choice.refused) fmt::print(out, "refused: the {} {}\n", name, reason);
  out << '\n';
  write_coefficients(out, choice.chosen);
  if (!doubt.empty()) fmt::print(out, "\nwarning: {}\n", doubt);
  return 0;
}

}  // namespace server::cli
