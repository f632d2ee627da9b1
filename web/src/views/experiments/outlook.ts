// All that the page computes of a profile while somebody types: its runs, what is predicted of each, and what is wrong.

import type { Controller, FluidsInForce } from '../../experiments_api';
import { fluid_text } from '../../format';
import { different_runs, kMostPreviewed, kPaperModels, limit_problem, preview_run, type RunPreview } from './preview';
import type { Sections } from './preview';
import { read_profile, variants_of, type Profile } from './profile';
import { TextError } from './toml';

export interface Plan {
  profile: Profile | null;
  fault: { line: number; text: string } | null;
  runs: RunPreview[]; // one of each combination, kMostPreviewed at most
  runs_planned: number;
  duration_s: number; // of all runs
  longest_s: number;
  problems: { run: number; text: string }[]; // run from 1, as in `runs`
}

const kNothing: Plan = {
  profile: null,
  fault: null,
  runs: [],
  runs_planned: 0,
  duration_s: 0,
  longest_s: 0,
  problems: [],
};
const kBetweenRuns_s = 10; // of a profile with until: the fit, roughly

export interface Surroundings {
  fluid: string; // that the robot is in, '': not known
  fluids: FluidsInForce | null;
  controller: Controller | null;
}

// The model of the fluid, or where it has none the paper's.
export function model_for(fluid: string, fluids: FluidsInForce | null): { model: Sections; name: string } {
  const own = fluids?.fluids.find((each) => each.fluid === fluid)?.model;
  if (own) return { model: own, name: `the model of ${fluid_text(fluid)}` };
  const name = fluid === 'water' ? '(28)' : '(29)';
  return { model: kPaperModels[name], name: `model ${name} of the paper` };
}

export function plan_of(text: string, surroundings: Surroundings): Plan {
  if (text.trim() === '') return kNothing;
  let profile: Profile;
  try {
    profile = read_profile(text);
  } catch (error) {
    if (!(error instanceof TextError)) throw error;
    return { ...kNothing, fault: { line: error.line, text: error.message } };
  }
  const { fluids, controller } = surroundings;
  const runs = different_runs(profile)
    .slice(0, kMostPreviewed)
    .map((variant) => {
      const fluid = variant.fluid || surroundings.fluid;
      const found = preview_run(profile, variant, model_for(fluid, fluids).model, controller);
      const limits = fluids?.fluids.find((each) => each.fluid === fluid)?.limits ?? fluids?.limits_where_unknown;
      const forbidden = limits && limit_problem(found.line, limits, fluid);
      return forbidden ? { ...found, problems: [forbidden, ...found.problems] } : found;
    });
  const longest_s = Math.max(0, ...runs.map((run) => run.duration_s));
  const is_choice = profile.until !== '';
  const runs_planned = is_choice ? profile.most_runs : variants_of(profile).length;
  const different = different_runs(profile).length;
  const mean_s = runs.reduce((sum, run) => sum + run.duration_s, 0) / Math.max(1, runs.length);
  return {
    profile,
    fault: null,
    runs,
    runs_planned,
    longest_s,
    duration_s: is_choice ? runs_planned * (longest_s + kBetweenRuns_s) : mean_s * different * profile.repeats,
    problems: runs.flatMap((run, index) => run.problems.map((problem) => ({ run: index + 1, text: problem }))),
  };
}
