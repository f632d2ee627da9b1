// A recorded run played again: everything that the view of a robot shows, at a moment of the past.
//
// SAFETY: nothing here acts on a robot, and no part that does is drawn; the stop beside it acts on the robot that it names,
// now. The frame and the word at the top say that this is the past.

import type { ComponentChildren } from 'preact';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { date_and_time, fluid_text, words } from '../../../format';
import { LogLines } from '../../../parts/log_strip';
import { Annunciator } from '../../../parts/mode_annunciator';
import { plot_settings } from '../../../plots/strips';
import { Readouts } from '../../../parts/readouts';
import { PlotBar } from '../../../plots/plot_bar';
import { StripHost } from '../../../plots/strip_host';
import { XyPlot } from '../../../plots/xy_plot';
import { change_query, format, route, type Route } from '../../../route';
import type { Session } from '../../../session';
import type { RunPage } from '../run_page';
import type { Run } from '../runs_api';
import { period_us_of } from '../traces';
import { useRunPage } from '../use_run_page';
import { PastVessel } from './past_vessel';
import { at_text, parse_address } from './player';
import { lines_of, marks_of, Replay, type Extent } from './replay';
import { act_of, is_taken, type Act } from './replay_keys';
import { ReplayScene, spans_of } from './replay_scene';
import { Transport } from './transport';
import { unread_text, useCommands, useLosses, useRead } from './use_what_is_listed';

const kAddress_ms = 1000; // between two changes of the address while it plays

interface Props {
  session: Session;
  page: RunPage;
  route: Route;
}

export function ReplayView({ session, page, route }: Props) {
  useRunPage(session, page);
  const run = page.run.value;
  const extent = extent_of(page);
  const text = page.problem.value && !run ? page.problem.value : run ? nothing_text(run, extent, page) : '';
  if (!run || !extent || text) {
    return (
      <Frame run_id={page.run_id} run={run}>
        {text ? (
          <div class="waiting" id="no-replay">
            <h2>This run cannot be replayed</h2>
            <p role="alert">{text}</p>
            <a class="button" href={format({ view: 'runs', parts: run ? [String(page.run_id)] : [] })}>
              {run ? `Show run ${page.run_id}` : 'Show all runs'}
            </a>
          </div>
        ) : (
          <p class="quiet replay-reading">Run {page.run_id} is being read…</p>
        )}
      </Frame>
    );
  }
  return <OneReplay session={session} page={page} route={route} run={run} extent={extent} />;
}

// From the first to the last sample.
function extent_of(page: RunPage): Extent | null {
  const whole = page.whole.value;
  const [first_us, last_us] = [whole?.first_utc_us[0], whole?.last_utc_us.at(-1)];
  if (!whole || first_us === undefined || last_us === undefined) return null;
  return { first_us, last_us, period_us: period_us_of(whole) };
}

function nothing_text(run: Run, extent: Extent | null, page: RunPage): string {
  if (run.state === 'discarded') return 'It was discarded: its samples are no longer held.';
  if (extent || !page.whole.value) return page.traces_problem.value && !extent ? page.traces_problem.value : '';
  return run.state === 'open' ? 'Nothing of it is recorded yet.' : 'The station holds no sample of it.';
}

interface FrameProps {
  run_id: number;
  run: Run | null;
  transport?: ComponentChildren;
  children: ComponentChildren;
}

// SAFETY: around all that is of the past, and nothing else.
function Frame({ run_id, run, transport, children }: FrameProps) {
  const when = run ? ` · ${date_and_time(run.started_at_us / 1000)}` : '';
  return (
    <>
      <section class="view-head replay replay-head" aria-label="Replay">
        <h1 id="replay-sign">
          <strong>Replay</strong> · run {run_id}
          {when} · <em>past</em>
        </h1>
        <p class="way-back">
          <a href={format({ view: 'runs', parts: [String(run_id)] })}>Run #{run_id}</a>
          {run && ` ${run.name} · ${run.robot_id}${run.fluid ? ` · ${fluid_text(run.fluid)}` : ''}`}
        </p>
        {transport}
      </section>
      <main class="view-body replay replay-body" id="replay" aria-label={`Replay of run ${run_id}, past`}>
        {children}
      </main>
    </>
  );
}

function OneReplay({ session, page, route, run, extent }: Props & { run: Run; extent: Extent }) {
  const { replay, scene } = useReplay(session, page, run, extent);
  const asked = useAddress(replay, route);
  useClock(replay);
  useKeys(replay);
  const { gaps_s, out_of_reach, problems } = useWhatHappened(session, page, run, replay, scene, extent);
  const losses = useLosses(session, page);
  const unread = unread_text({ ...problems, 'lost samples': losses.problem });
  const now = replay.readout.value;
  const situation = replay.situation.value;
  const whole = page.whole.value;
  const lamps = { ...now, emergency_cause: situation?.emergency_cause ?? '' };
  return (
    <Frame
      run_id={run.run_id}
      run={run}
      transport={
        whole && (
          <Transport
            replay={replay}
            whole={whole}
            gaps_s={gaps_s}
            note={asked}
            losses={losses.answer}
            unread={unread}
            out_of_reach={out_of_reach}
          />
        )
      }
    >
      <div class="replay-stage">
        <div class="replay-scope">
          <Annunciator name={run.robot_id} note="past" lamps={lamps} is_stale={now.stale}>
            <span class="unseen">
              {`Then, ${run.robot_id}: ${now.mode || 'not known'} ${now.mode === 'auto' ? words(now.sub_state) : ''}`}
            </span>
          </Annunciator>
          <Readouts robot={replay} label="Recorded at this moment" />
          <PastVessel now={now} />
          <section class="plots" aria-label="Plots up to this moment">
            <PlotBar
              state={scene.state}
              note={scene.note}
              settings={plot_settings}
              spans={spans_of(replay.length_s.value)}
              on_span={(span_s) => scene.show(span_s)}
            />
            <StripHost
              scene={scene}
              label="Plots up to the moment: dragging moves the moment, the wheel shows more or less"
              on_key={() => false}
            />
            <XyPlot scene={scene} />
          </section>
        </div>
        <section class="replay-log log-strip" aria-label="What had happened until then">
          <h2>As it happened</h2>
          <LogLines
            lines={replay.lines.value}
            none={problems.commands || problems['events and markers'] ? 'Not known: it could not be read.' : undefined}
          />
        </section>
      </div>
    </Frame>
  );
}

function useReplay(session: Session, page: RunPage, run: Run, extent: Extent) {
  const { api } = session;
  const made = useMemo(() => {
    const ways = {
      samples: (from_us: number, to_us: number, limit: number) =>
        api.robot_samples(run.robot_id, from_us, to_us, limit),
      set_timer: (callback: () => void, delay_ms: number) => setTimeout(callback, delay_ms),
    };
    const replay = new Replay(extent, ways, () => performance.now());
    return { replay, scene: new ReplayScene(session, replay, run.robot_id, plot_settings) };
  }, [page, extent.first_us]);
  useEffect(() => made.replay.extend(extent), [made, extent.last_us]);
  useEffect(
    () => () => {
      made.replay.close();
      made.scene.close();
    },
    [made],
  );
  return made;
}

// The address says where it begins, and follows: at each pause, and once a second while it plays. Gives what is wrong in it.
function useAddress(replay: Replay, { query }: Route): string {
  const followed = useRef<string | null>(null); // the address that was last followed or written
  const shown = useRef(''); // what it led to: as long as that stays, so does what was typed
  const asked = parse_address(query, replay.length_s.value);
  const { player } = replay;
  const key_of = (at = '', speed = '') => `${at} ${speed}`;
  const now = () => ({ at: at_text(player.at_s.peek()), speed: String(player.speed.peek()) });
  useEffect(() => {
    const key = key_of(query['at'], query['speed']);
    if (key === followed.current) return;
    followed.current = key;
    if (asked.speed !== null) player.set_speed(asked.speed);
    replay.seek(asked.at_s ?? 0);
    shown.current = key_of(now().at, now().speed);
  }, [replay, query['at'], query['speed']]);
  const write = () => {
    const { at, speed } = route.peek().query;
    if (key_of(at, speed) !== followed.current) return; // another address has come, and is followed first
    const next = now();
    const key = key_of(next.at, next.speed);
    if (key === shown.current) return;
    followed.current = shown.current = key;
    change_query(next);
  };
  const is_playing = player.is_playing.value;
  const at_rest_s = is_playing ? null : player.at_s.value;
  useEffect(() => {
    const timer = is_playing ? setInterval(write, kAddress_ms) : setTimeout(write, 200);
    return () => clearInterval(timer);
  }, [replay, is_playing, at_rest_s, player.speed.value]);
  return asked.problem;
}

// SAFETY: only while the page is drawn: a tab in the background does not run on unseen.
function useClock(replay: Replay): void {
  useEffect(() => {
    let frame = 0;
    const tick = (now_ms: number) => {
      replay.tick(now_ms);
      frame = requestAnimationFrame(tick);
    };
    frame = requestAnimationFrame(tick);
    return () => cancelAnimationFrame(frame);
  }, [replay]);
}

function useKeys(replay: Replay): void {
  useEffect(() => {
    const listener = (event: KeyboardEvent) => {
      const act = act_of(event);
      if (!act || is_taken(event.target as Partial<Element> | null, event.key)) return;
      event.preventDefault();
      if (!(event.repeat && act.do === 'toggle')) perform(replay, act);
    };
    addEventListener('keydown', listener);
    return () => removeEventListener('keydown', listener);
  }, [replay]);
}

function perform(replay: Replay, act: Act): void {
  switch (act.do) {
    case 'toggle':
      return replay.toggle();
    case 'step':
      return replay.step(act.by);
    case 'jump':
      return replay.jump(act.by);
    case 'move':
      return replay.seek(replay.player.at_s.peek() + act.by_s);
    case 'faster':
      return replay.player.faster(act.by);
    case 'end':
      return replay.seek(act.at === 'first' ? 0 : replay.length_s.peek());
  }
}

function useWhatHappened(
  session: Session,
  page: RunPage,
  run: Run,
  replay: Replay,
  scene: ReplayScene,
  extent: Extent,
) {
  const { commands, out_of_reach: commands_out, problem } = useCommands(session, run);
  const moments = page.moments.value;
  const events = page.events.value;
  // Of the whole run, however far the plots of its page have been zoomed.
  const gaps_s = page.gaps_s.value;
  useEffect(() => {
    const lines = lines_of(events, commands, moments, extent);
    replay.take_lines(lines);
    replay.take_marks(marks_of(moments, gaps_s, extent));
    scene.marks.take_log(lines, run.robot_id);
    scene.marks.take_markers(page.markers.value);
    scene.marks.set_runs([run]);
    scene.mark_dirty();
  }, [replay, moments, events, commands, gaps_s]);
  const predictions = useRead(session, () => scene.load_predictions(extent.first_us, extent.last_us), [scene]);
  const problems = { 'events and markers': page.unread.value, commands: problem, predictions: predictions.problem };
  const oldest_us = events.length === 1000 ? Math.min(...events.map((event) => event.received_at_us)) : 0;
  const events_out = oldest_us > extent.first_us;
  const what = [events_out && 'events', commands_out && 'commands'].filter(Boolean).join(' and ');
  const out_of_reach = what ? `The newest 1000 ${what} of this run are listed; there are earlier ones.` : '';
  return { gaps_s, out_of_reach, problems };
}
