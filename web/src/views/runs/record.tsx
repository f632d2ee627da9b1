// Beside the plots of a run: how complete its record is, its digest, its conditions, what is said of it, and its files.

import type { ComponentChildren } from 'preact';
import { draft_of, type DraftName } from '../../drafts';
import { count, date_and_time, duration, fluid_text } from '../../format';
import { GuardedButton } from '../../parts/hold_button';
import { OutcomeLine, useAsking } from '../../parts/request';
import { format } from '../../route';
import type { Session } from '../../session';
import { interruptions_text } from './moments';
import type { RunPage } from './run_page';
import type { Annotation, Certificate, Run, RunsApi } from './runs_api';
import { since_text } from './time_axis';

const kStation = 'the station';

interface RecordProps {
  session: Session;
  api: RunsApi;
  page: RunPage;
}

export function Record({ session, api, page }: RecordProps) {
  const run = page.run.value;
  if (!run) return null;
  const scopes = session.me.value?.scopes.split(',') ?? [];
  const may_write = scopes.includes('record');
  const may_give_up = scopes.includes('admin');
  return (
    <div class="record">
      <Completeness run={run} certificate={page.certificate.value} />
      {may_give_up && <GiveUp api={api} page={page} run={run} />}
      {may_write ? (
        <>
          <Said key={`said-${run.run_id}`} session={session} api={api} page={page} run={run} />
          <NewMarker session={session} api={api} page={page} run={run} />
        </>
      ) : (
        <SaidOnly run={run} />
      )}
      <Conditions run={run} />
      <Files run={run} may_export={may_write} />
    </div>
  );
}

// What the record has of the samples that the robot made, in a sentence.
export function completeness_text(run: Run, certificate: Certificate | null): { tone: string; text: string } {
  if (run.state === 'discarded') return { tone: 'caution', text: 'Discarded: its samples are no longer held.' };
  if (run.state === 'open') return { tone: '', text: `Recording: ${count(run.samples_stored)} samples so far.` };
  if (!certificate) return { tone: '', text: 'How complete it is, is being counted.' };
  const { samples_expected, samples_lost, samples_missing, lost_by_cause, longest_gap_samples } = certificate;
  const { missed_ticks, longest_missed_ticks } = certificate;
  const missed =
    missed_ticks === null
      ? ' What the robot missed is being counted.'
      : missed_ticks > 0
        ? ` Missed by the robot: ${count(missed_ticks)} ticks, at most ${count(longest_missed_ticks)} in a row.`
        : '';
  if (samples_lost === 0 && samples_missing === 0) {
    const tone = missed === '' ? 'good' : '';
    return { tone, text: `Recorded, nothing lost: all ${count(samples_expected)} samples.${missed}` };
  }
  const causes = Object.entries(lost_by_cause).map(([cause, lost]) => `${count(lost)} ${cause.replaceAll('_', ' ')}`);
  const parts = [
    samples_lost > 0 && `${count(samples_lost)} of ${count(samples_expected)} samples are lost (${causes.join(', ')})`,
    samples_missing > 0 && `${count(samples_missing)} are still missing: the robot may send them yet`,
    longest_gap_samples > 0 && `the longest gap has ${count(longest_gap_samples)}`,
  ].filter(Boolean);
  return { tone: 'caution', text: `${parts.join('; ')}.${missed}` };
}

function Completeness({ run, certificate }: { run: Run; certificate: Certificate | null }) {
  const { tone, text } = completeness_text(run, certificate);
  const waited = interruptions_text(run);
  return (
    <section aria-label="Record" id="completeness">
      <p class={`completeness ${tone}`}>{text}</p>
      {waited !== '' && <p id="interruptions">{waited}</p>}
      {certificate && (
        <p class="quiet">
          {certificate.samples_backfilled > 0 && `${count(certificate.samples_backfilled)} were sent again. `}
          {certificate.worst_clock_uncertainty_us >= 0
            ? `Its clock is exact within ${(certificate.worst_clock_uncertainty_us / 1000).toFixed(1)} ms.`
            : 'No sample has an estimate of its UTC.'}
        </p>
      )}
      {certificate?.sha256 && (
        <p class="digest">
          <span class="quiet">SHA-256</span> <code id="digest">{certificate.sha256.match(/.{8}/g)?.join(' ')}</code>
        </p>
      )}
      {certificate && !certificate.final && <p class="quiet">The digest is made when no sample is missing any more.</p>}
    </section>
  );
}

// Ends the wait for a robot that does not come back, for admins.
export function GiveUp({ api, page, run }: { api: RunsApi; page: RunPage; run: Run }) {
  const asking = useAsking('station');
  const certificate = page.certificate.value;
  const missing = certificate && !certificate.final ? certificate.samples_missing : 0;
  if (run.state === 'discarded' || (missing === 0 && asking.outcome.value.phase === 'idle')) return null;
  const give_up = async () => {
    const finalized = async () => (page.certificate.value = await api.finalize(run.run_id, missing));
    const is_done = await asking.ask('Giving up', finalized, kStation);
    if (!is_done) page.certificate.value = await api.certificate(run.run_id); // another number may be missing now
  };
  return (
    <section aria-label="Samples that are missing">
      {missing > 0 && (
        <>
          <p class="quiet">
            If {run.robot_id} does not come back: what is given up is lost for good, also if it does, and the run is
            final.
          </p>
          <GuardedButton id="give-up" disabled={asking.pending} on_held={() => void give_up()}>
            Hold to give up {count(missing)} samples
          </GuardedButton>
        </>
      )}
      <OutcomeLine asking={asking} id="give-up-outcome" />
    </section>
  );
}

type OfRunProps = RecordProps & { run: Run };

export function Said({ session, api, page, run }: OfRunProps) {
  const asking = useAsking('station');
  const draft = (of: DraftName) => draft_of(session, `${run.run_id}`, of); // null: as it is
  const [name, notes, verdict] = [draft('run_name'), draft('run_notes'), draft('run_verdict')];
  const change: Annotation = {};
  if (name.value !== null && name.value.trim() !== run.name) change.name = name.value.trim();
  if (notes.value !== null && notes.value !== run.notes) change.notes = notes.value;
  if (verdict.value !== null && verdict.value !== run.verdict) change.verdict = verdict.value;
  const is_changed = Object.keys(change).length > 0;
  const save = async () => {
    if (change.name === '') return asking.fail('A run has a name: write one of at least one letter.');
    const sent = [name, notes, verdict].map((each) => ({ each, text: each.peek() }));
    const saved = await asking.ask(
      'Change',
      async () => (page.run.value = await api.annotate(run.run_id, change)),
      kStation,
    );
    if (!saved) return;
    for (const { each, text } of sent) if (each.peek() === text) each.value = null; // else it was typed meanwhile
  };
  return (
    <form
      class="said"
      aria-label="What is said of the run"
      onSubmit={(event) => {
        event.preventDefault();
        void save();
      }}
    >
      <label for="said-name">Name</label>
      <input
        id="said-name"
        autoComplete="off"
        maxLength={200}
        value={name.value ?? run.name}
        onInput={(event) => (name.value = event.currentTarget.value)}
      />
      <label for="said-verdict">Verdict</label>
      <input
        id="said-verdict"
        autoComplete="off"
        maxLength={4000}
        placeholder="none yet"
        value={verdict.value ?? run.verdict}
        onInput={(event) => (verdict.value = event.currentTarget.value)}
      />
      <label for="said-notes">Notes</label>
      <textarea
        id="said-notes"
        rows={3}
        maxLength={4000}
        placeholder="none yet"
        value={notes.value ?? run.notes}
        onInput={(event) => (notes.value = event.currentTarget.value)}
      />
      <button type="submit" id="save-said" disabled={!is_changed || asking.pending}>
        Save
      </button>
      <OutcomeLine asking={asking} id="said-outcome" />
    </form>
  );
}

export function NewMarker({ session, api, page, run }: OfRunProps) {
  const asking = useAsking('station');
  const draft = draft_of(session, `${run.run_id}`, 'marker');
  const text = draft.value ?? '';
  const at_s = page.picked_s.value;
  if (at_s === null) return <p class="quiet">Click on a plot to put a marker there.</p>;
  const add = async () => {
    if (text.trim() === '') return asking.fail('Write what happened there.');
    const at_us = page.origin_us + at_s * 1e6;
    const added = await asking.ask(
      'Marker',
      async () => {
        await api.add_marker(run.robot_id, text.trim(), at_us);
        page.markers.value = await api.markers(run.run_id);
      },
      kStation,
    );
    if (!added) return;
    draft.value = null;
    page.picked_s.value = null;
  };
  return (
    <form
      class="said"
      aria-label="New marker"
      onSubmit={(event) => {
        event.preventDefault();
        void add();
      }}
    >
      <label for="marker-text">Marker at {since_text(at_s)}</label>
      <input
        id="marker-text"
        autoComplete="off"
        maxLength={4000}
        placeholder="What happened"
        value={text}
        onInput={(event) => (draft.value = event.currentTarget.value)}
      />
      <span class="pair-of-buttons">
        <button type="submit" id="add-marker" disabled={asking.pending}>
          Add marker
        </button>
        <button type="button" onClick={() => (page.picked_s.value = null)}>
          Not here
        </button>
      </span>
      <OutcomeLine asking={asking} id="marker-outcome" />
    </form>
  );
}

const SaidOnly = ({ run }: { run: Run }) => (
  <section aria-label="What is said of the run">
    <Facts
      facts={[
        ['Verdict', run.verdict],
        ['Notes', run.notes],
      ]}
    />
  </section>
);

function Conditions({ run }: { run: Run }) {
  const ended = run.ended_at_us === null ? 'open' : date_and_time(run.ended_at_us / 1000);
  return (
    <section aria-label="Conditions" id="conditions">
      <h2>Conditions</h2>
      <Facts
        facts={[
          ['Robot', <a href={`#/robot/${encodeURIComponent(run.robot_id)}`}>{run.robot_id}</a>],
          ['Began', date_and_time(run.started_at_us / 1000)],
          ['Ended', run.state === 'interrupted' ? `${ended}, the station stopped` : ended],
          ['Fluid', run.fluid && fluid_text(run.fluid)],
          ['Pump', run.pump_profile],
          ['Mean flow', run.mean_flow_m_s !== null && `${(run.mean_flow_m_s * 1000).toFixed(1)} mm/s`],
          ['Tube', run.tube],
          ['Operator', run.operator_name],
          ['Profile', run.profile],
          [
            'Experiment',
            run.experiment && (
              <>
                <a href={format({ view: 'experiments', parts: [String(run.experiment.experiment_id)] })}>
                  {run.experiment.experiment_id}
                </a>
                , run {run.experiment.number}
              </>
            ),
          ],
          ['Begun by', run.made_by + (run.made_afterwards ? ', afterwards' : '')],
          ['Firmware', run.firmware_version],
          ['Controller', `${run.controller_id} (${run.controller_checksum.toString(16).padStart(8, '0')})`],
          ['Parameters', run.parameters_checksum.toString(16).padStart(8, '0')],
          ['Boots', run.spans.length > 1 && `${run.spans.length}: the robot restarted in it`],
        ]}
      />
    </section>
  );
}

// What is empty is left out.
function Facts({ facts }: { facts: [string, ComponentChildren | false][] }) {
  const known = facts.filter(([, value]) => value !== false && value !== '' && value !== null);
  if (known.length === 0) return <p class="quiet">Nothing was noted.</p>;
  return (
    <dl class="facts">
      {known.map(([name, value]) => (
        <div key={name}>
          <dt>{name}</dt>
          <dd>{value}</dd>
        </div>
      ))}
    </dl>
  );
}

const kFiles: readonly { name: string; text: string; what: string; exports: boolean }[] = [
  { name: 'report.html', text: 'Report', what: 'one HTML file that prints well', exports: false },
  { name: 'samples.csv', text: 'CSV', what: 'a line per sample', exports: true },
  { name: 'samples.mat', text: 'MAT', what: 'for MATLAB and Octave', exports: true },
  { name: 'samples.sqlite', text: 'SQLite', what: 'with events, commands, markers', exports: true },
  { name: 'samples.mcap', text: 'MCAP', what: 'for Foxglove', exports: true },
  { name: 'capsule.eln', text: 'Archive .eln', what: 'all of it, to check and compute again', exports: true },
];

function Files({ run, may_export }: { run: Run; may_export: boolean }) {
  const is_held = run.state !== 'discarded';
  const has_ended = run.state !== 'open';
  const offered = kFiles.filter(
    ({ name, exports }) => (may_export || !exports) && (has_ended || name !== 'capsule.eln'),
  );
  return (
    <section aria-label="Files" id="files">
      <h2>Files</h2>
      {is_held ? (
        <ul class="files">
          {offered.map(({ name, text, what }) => (
            <li key={name}>
              <a href={`/api/v1/runs/${run.run_id}/${name}`} download="">
                {text}
              </a>
              <span class="quiet">{what}</span>
            </li>
          ))}
        </ul>
      ) : (
        <p class="quiet">A discarded run has no files.</p>
      )}
      {!may_export && <p class="quiet">Exports of samples need the role operator.</p>}
    </section>
  );
}

export const length_text = (run: Run) =>
  run.ended_at_us === null ? 'open' : duration((run.ended_at_us - run.started_at_us) / 1000);
