// What to offer when a tuning specification has no solution: the nearest that has one, and designs that give up less
// important requirements.
//
// Only sound designs are offered (is_sound of design.hpp). Nearest crossovers are looked for within a factor of 1e6, in
// steps of 2 %, and margins in 60 steps of the range of a crossover, so that a band narrower than that may be missed.
// What is offered lies a little inside the region of sound designs: 0.1 degrees or 0.1 % of the frequency, or less
// where the region is narrow. All of it can be asked for: it lies within tuning_ranges.hpp, or, where the crossover of
// the specification does not, between these ranges and that crossover. Errors: none; the arguments have been checked.
#pragma once

#include "control/tuning/design.hpp"
#include "control/tuning/feasible_margins.hpp"

namespace control {

// Tunes to a specification that has a solution, with this mu, and measures what came of it. None where controller_for
// has none.
std::optional<TunedController> tuned_controller(const FractionalModel& plant, const TuningSpec& spec, double mu,
                                                std::string name);

// The phase margins with a sound iso-damped design at the specification's crossover, in ascending ranges: tried in 60
// steps, and at the margin of the specification itself, which so lies in one of them exactly if tune grants it. Its mu
// does not matter.
std::vector<PhaseMarginRange> sound_phase_margins(const FractionalModel& plant, const TuningSpec& spec);

// A mu that gives up less than the specification asks for, at its crossover and phase margin, and the name of that.
struct RelaxedOrder {
  double mu = 0;
  std::string name;
};

std::vector<RelaxedOrder> relaxed_orders(const TuningDemand& demand, const TuningSpec& spec);

std::vector<TunedController> nearest_designs(const FractionalModel& plant, const TuningSpec& spec);
std::vector<TunedController> relaxed_designs(const FractionalModel& plant, const TuningSpec& spec);

}  // namespace control
