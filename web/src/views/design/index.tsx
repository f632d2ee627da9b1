// Design: from recorded runs to a controller on a robot that was tried, on one page. Each choice stands in the address.

import { useEffect, useLayoutEffect } from 'preact/hooks';
import { refusal, useAsked } from '../experiments/acts';
import type { ViewProps } from '../table';
import { address_of, note_in_address, parse_design } from './address';
import { IdentifyStep } from './identify_step';
import { Kept } from './kept';
import { PushStep } from './push_step';
import { useInForce, useRuns } from './parts';
import { RunsStep } from './runs_step';
import { tune_body, TuneStep } from './tune_step';
import { VerifyStep } from './verify_step';
import { work_of, type DesignWork } from './work';
import { parse } from '../../route';

export default function DesignView({ session, route }: ViewProps) {
  const work = work_of(session);
  const design = parse_design(route.query);
  const address = address_of(design);
  const { steps } = work;
  // The view that is opened without anything chosen goes on where it was left.
  useLayoutEffect(() => {
    const left = steps.last;
    if (Object.keys(route.query).length === 0 && left !== null) note_in_address(parse_design(parse(left).query));
    steps.open(left !== null && Object.keys(route.query).length === 0 ? left : address);
  }, []);
  useEffect(() => steps.follow(address), [address]);
  // SAFETY: the robot that is chosen here is the one that the stop button names. It is followed when the address changes.
  useLayoutEffect(() => {
    if (design.robot !== '') session.store.want(design.robot);
  }, [design.robot]);

  const runs = useRuns(session, [...design.runs, ...(design.verified === null ? [] : [design.verified])]);
  const designs = useAsked(session, work.api.designs, [work.kept.value]);
  const model = useAsked(session, async () => {
    const id = design.model;
    return id === null ? null : { id, found: await work.api.design(id).catch((error: unknown) => refusal(error)) };
  }, [design.model]);
  const model_found = model.answer?.id === design.model ? (model.answer?.found ?? null) : null;
  const in_force = useInForce(session, work);
  const body = tune_body(design, in_force.found?.controller ?? null);
  const tune = body && { body, key: JSON.stringify(body) };
  const shared = { session, work, design, runs, designs: designs.answer ?? [], model: model_found, in_force, tune };
  return (
    <>
      <section class="view-head design-head" aria-label="Steps back and forth">
        <h1>Design</h1>
        <p class="quiet">From recorded runs to a controller on a robot, step by step. Each choice is in the address.</p>
        <div class="design-undo">
          <button type="button" id="design-undo" disabled={!steps.can_undo.value} onClick={() => steps.undo()}>
            Undo
          </button>
          <button type="button" id="design-redo" disabled={!steps.can_redo.value} onClick={() => steps.redo()}>
            Redo
          </button>
        </div>
        <Overview work={work} />
      </section>
      <main class="view-body design-view" aria-label="Design">
        <RunsStep {...shared} />
        <IdentifyStep {...shared} />
        <TuneStep {...shared} />
        <PushStep {...shared} />
        <VerifyStep {...shared} />
        <Kept {...shared} problem={designs.problem} is_asked={designs.answer !== null} />
      </main>
    </>
  );
}

const kSteps = [
  { name: 'runs', title: 'Runs' },
  { name: 'identify', title: 'Identify' },
  { name: 'tune', title: 'Tune' },
  { name: 'push', title: 'Send' },
  { name: 'verify', title: 'Compare' },
] as const;

// How far it is; a press leads to the step.
function Overview({ work }: { work: DesignWork }) {
  const states = work.states.value;
  return (
    <ol class="design-overview" aria-label="Steps">
      {kSteps.map(({ name, title }, at) => (
        <li key={name} class={states[name]?.kind ?? 'needs'}>
          <button
            type="button"
            id={`design-to-${name}`}
            title={states[name]?.text}
            onClick={() => document.getElementById(`design-part-${name}`)?.scrollIntoView({ block: 'start' })}
          >
            <span class="design-number">{at + 1}</span>
            <span>{title}</span>
          </button>
        </li>
      ))}
    </ol>
  );
}
