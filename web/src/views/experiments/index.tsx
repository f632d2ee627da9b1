// Experiments: what runs and waits, one of them, a new one, and who has which robot when.
//
//   #/experiments   #/experiments/3   #/experiments/3?run=2   #/experiments/new?profile=figure_7&robot=sim-1
//   #/experiments/reservations

import { format } from '../../route';
import type { ViewProps } from '../table';
import { Begin } from './begin';
import { OneExperiment } from './one';
import { Queue } from './queue';
import { Reservations } from './reservations';

const kNumber = /^[1-9]\d{0,14}$/;
const kTabs = [
  { part: undefined, id: 'tab-queue', text: 'Queue' },
  { part: 'new', id: 'tab-new', text: 'New experiment' },
  { part: 'reservations', id: 'tab-reservations', text: 'Reservations' },
] as const;

export default function ExperimentsView(props: ViewProps) {
  const part = props.route.parts[0];
  return (
    <>
      <section class="view-head" aria-label="Parts of Experiments">
        <h1>Experiments</h1>
        <nav class="tabs" aria-label="Experiments">
          {kTabs.map((tab) => (
            <a
              key={tab.id}
              id={tab.id}
              href={format({ view: 'experiments', parts: tab.part ? [tab.part] : [] })}
              aria-current={part === tab.part ? 'page' : undefined}
            >
              {tab.text}
            </a>
          ))}
        </nav>
      </section>
      <main class="view-body experiments-view" aria-label="Experiments">
        <Part {...props} />
      </main>
    </>
  );
}

function Part(props: ViewProps) {
  const part = props.route.parts[0];
  if (part === undefined) return <Queue {...props} />;
  if (part === 'new') return <Begin {...props} />;
  if (part === 'reservations') return <Reservations {...props} />;
  if (kNumber.test(part)) {
    const { run = '' } = props.route.query;
    const asked_run = kNumber.test(run) ? Number(run) : null;
    return <OneExperiment key={part} session={props.session} id={Number(part)} asked_run={asked_run} />;
  }
  return (
    <div class="waiting">
      <h2>Nothing is at this address</h2>
      <p>
        “{part}” is no number of an experiment. <a href={format({ view: 'experiments' })}>All experiments</a>
      </p>
    </div>
  );
}
