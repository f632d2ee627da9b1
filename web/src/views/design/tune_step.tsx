// Step 3: a controller for the model. The page draws the loop at once; what is kept and sent is the station's answer.

import { useEffect, useMemo } from 'preact/hooks';
import { Choice } from '../../parts/choice';
import type { Fluid } from '../../api';
import { fluid_text } from '../../format';
import { kCrossover, change_design, with_plant, type Design } from './address';
import { Ask, specification_of, useAskMoves, with_specification } from './ask';
import { plant_of, type ControllerInForce, type StoredDesign, type Tuned } from './design_api';
import { kPaperPlants, solve, type Plant } from './frequency';
import type { JobBody } from './jobs';
import { LoopPlots } from './loop_plots';
import type { StepProps } from './parts';
import { RegionMap } from './region_map';
import { Step } from './step';
import { StepPlots } from './step_plots';
import { Achievement, Predictions } from './tune_result';
import { plant_text, state_of } from './words';
import { may_record } from './identify_step';

const kMapPoints = 90;

type PlantChoice = { model_id: number } | { fluid: string } | { plant: Plant };

export function plant_choice(design: Design): PlantChoice | null {
  if (design.model !== null) return { model_id: design.model };
  if (design.fluid !== '') return { fluid: design.fluid };
  return design.paper === '' ? null : { plant: kPaperPlants[design.paper] };
}

// The duty range and period are those of the robot, so that it is predicted as it will run.
export function tune_body(design: Design, in_force: ControllerInForce['controller']): JobBody | null {
  const choice = plant_choice(design);
  if (!choice) return null;
  const robot =
    in_force && typeof in_force.duty_min === 'number' && typeof in_force.duty_max === 'number'
      ? { duty_min: in_force.duty_min, duty_max: in_force.duty_max, period_s: in_force.period_us / 1e6 }
      : {};
  return {
    kind: 'tune',
    ...choice,
    crossover_rad_s: design.crossover_rad_s,
    phase_margin_deg: design.margin_deg,
    ...robot,
  } as JobBody;
}

const plant_of_fluid = (fluids: readonly Fluid[], name: string): Plant | null => {
  const model = fluids.find(({ fluid }) => fluid === name)?.model as { plant?: unknown } | null | undefined;
  return model?.plant ? plant_of(model.plant) : null;
};

export function TuneStep(props: StepProps) {
  const { session, work, design, model, tune, in_force } = props;
  const is_live = session.phase.value === 'live';
  const fluids = session.fluids.value ?? [];
  const plant = useMemo(() => {
    if (design.model !== null) return model === null || typeof model === 'string' ? null : plant_of(model.document);
    if (design.fluid !== '') return plant_of_fluid(fluids, design.fluid);
    return design.paper === '' ? null : kPaperPlants[design.paper];
  }, [design.model, design.fluid, design.paper, model, fluids]);
  const map_body = map_body_of(design);
  const map_key = JSON.stringify(map_body);
  // The loop first; the map takes longer and changes with the plant alone.
  useEffect(() => {
    if (!is_live || !in_force.is_read || tune === null || plant === null || !may_record(session)) return;
    work.tuning.ask(tune.key, tune.body);
    if (map_body) work.map.ask(map_key, map_body);
  }, [is_live, in_force.is_read, tune?.key, map_key, plant === null, session.me.value]);

  const move = useAskMoves(work, design);
  const dragged = work.dragged.value;
  const asked = dragged ?? specification_of(design);
  const tuned = dragged === null ? (work.tuning.answer_to(tune?.key)?.result ?? null) : null;
  const own = useMemo(
    () => (plant ? solve(plant, asked) : null),
    [plant, asked.crossover_rad_s, asked.phase_margin_deg],
  );
  const near = tuned?.feasible === false ? (tuned.nearest_all[0] ?? null) : null;
  const law = near ?? (tuned?.feasible ? tuned : (own?.law ?? null));
  const map = work.map.answer.value;
  return (
    <Step work={work} number={3} name="tune" title="Tune a controller" state={tune_state(props, plant)} share={null}>
      <div class="design-tune-top">
        <div>
          <PlantList {...props} fluids={fluids} />
          <Ask asked={asked} on_move={move} />
          {plant && (
            <Achievement
              asked={asked}
              tuned={tuned}
              own={own}
              is_dragged={dragged !== null}
              on_ask={(other) => change_design(with_specification(design, other))}
            />
          )}
        </div>
        {plant && (
          <RegionMap
            answer={map.key === map_key ? map : { ...map, result: null, phase: 'asking' }}
            asked={asked}
            on_move={move}
          />
        )}
      </div>
      {plant && (
        <>
          <div class="design-loop" id="design-loop" data-source={tuned ? 'station' : 'page'}>
            <LoopPlots plant={plant} law={law} asked={asked} near={near} is_final={tuned?.feasible === true} />
            <StepPlots tuned={tuned?.feasible ? tuned : null} is_feasible={tuned?.feasible !== false} />
          </div>
          {tuned?.feasible && <Predictions tuned={tuned} fluids={fluids} />}
        </>
      )}
    </Step>
  );
}

function map_body_of(design: Design): JobBody | null {
  const choice = plant_choice(design);
  return choice
    ? ({
        kind: 'tuning_map',
        ...choice,
        from_rad_s: kCrossover.from,
        to_rad_s: kCrossover.to,
        points: kMapPoints,
      } as JobBody)
    : null;
}

function tune_state({ session, work, design, model, tune }: StepProps, plant: Plant | null) {
  const answer = work.tuning.answer_to(tune?.key);
  if (plant_choice(design) === null) return { kind: 'needs', text: 'needs a model' } as const;
  if (typeof model === 'string' && design.model !== null) return { kind: 'failed', text: `failed: ${model}` } as const;
  if (plant === null && design.fluid !== '' && session.fluids.value !== null)
    return { kind: 'failed', text: `${fluid_text(design.fluid)} has no model with a plant` } as const;
  if (!may_record(session)) return { kind: 'needs', text: 'needs the role operator' } as const;
  if (work.dragged.value !== null) return { kind: 'running', text: 'asked when the slider rests' } as const;
  if (answer === null) return { kind: 'running', text: 'asking' } as const;
  const state = state_of(answer, { kind: 'running', text: 'asking' });
  return answer.result?.feasible === false ? ({ kind: 'failed', text: 'not feasible' } as const) : state;
}

function PlantList({ design, designs, model, fluids }: StepProps & { fluids: readonly Fluid[] }) {
  const value =
    design.model !== null
      ? `model ${design.model}`
      : design.fluid !== ''
        ? `fluid ${design.fluid}`
        : design.paper !== ''
          ? `paper ${design.paper}`
          : '';
  const models = designs.filter(({ kind }) => kind === 'model');
  const known = models.some(({ design_id }) => design_id === design.model);
  const own = !known && design.model !== null && model !== null && typeof model !== 'string' ? [model] : [];
  const named = (each: Pick<StoredDesign, 'design_id' | 'name'>) => ({
    value: `model ${each.design_id}`,
    text: `${each.name} (model ${each.design_id})`,
  });
  const options = [
    ...(value === '' ? [{ value: '', text: 'choose a model' }] : []),
    ...[...own, ...models].map(named),
    ...fluids
      .filter(({ fluid }) => plant_of_fluid(fluids, fluid) !== null)
      .map(({ fluid }) => ({ value: `fluid ${fluid}`, text: `the model of ${fluid_text(fluid)}` })),
    { value: 'paper 29', text: plant_text({ model: null, fluid: '', paper: '29' }) },
    { value: 'paper 28', text: plant_text({ model: null, fluid: '', paper: '28' }) },
  ];
  const choose = (said: string) => {
    const [kind = '', ...rest] = said.split(' ');
    const name = rest.join(' ');
    if (kind === 'model') change_design(with_plant(design, { model: Number(name) }));
    else if (kind === 'fluid') change_design(with_plant(design, { fluid: name }));
    else change_design(with_plant(design, { paper: name === '28' ? '28' : '29' }));
  };
  return (
    <div class="design-plant">
      <span class="design-label">Tuned for</span>
      <Choice id="design-plant" label="Model that is tuned for" options={options} value={value} on_choose={choose} />
    </div>
  );
}

export type { Tuned };
