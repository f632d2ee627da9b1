// The tube that the robot swims in: where it believes to be with its "±", where it would come to rest if it were stopped
// now, the position limits, and the setpoint, which can be moved and is sent once, on release.
//
// The station knows no tubes and no reservoirs, so one tube is drawn, open at both ends; the robot is not to scale.

import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import { next_range } from '../range';
import { m_to_millimetres, millimetres } from '../format';
import { useCloseOnEscape } from '../keys';
import type { Robot } from '../robot';
import type { Session } from '../session';
import { Coast, kNothingKnown, known_of, type Known } from '../vessel/coast';
import { Ghost, why_not, type Bounds } from '../vessel/ghost';
import { OutcomeLine, useAsking } from './request';
import { kLeastSpan_m, Scale, Tube, TubePlaces } from './tube';

const kLeastCoast_m = 0.001; // less is not worth a second robot
const kHint = 'Drag the magenta handle, or move it by keys, to send another setpoint.';
const kKeys_m: Record<string, number> = {
  ArrowLeft: -0.001,
  ArrowDown: -0.001,
  ArrowRight: 0.001,
  ArrowUp: 0.001,
  PageDown: -0.01,
  PageUp: 0.01,
};

export function Vessel({ session, robot }: { session: Session; robot: Robot }) {
  const now = robot.readout.value;
  const { estimate_m, position_m, setpoint_m, stale } = now;
  const known = useKnown(session, robot);
  const coast = useMemo(() => known.model && new Coast(known.model), [known]);
  const rest_m = resting_place(robot, coast);
  const asking = useAsking();
  const ghost = useRef(new Ghost()).current;
  const target_m = useSignal<number | null>(null);
  const tube = useRef<HTMLDivElement>(null);
  const range = useRef<[number, number]>([-0.05, 0.25]);
  const bounds = bounds_of(session, robot, known);
  const reason = why_not(circumstances(session, robot));
  const complaint = useSignal('');

  const abandon = () => {
    ghost.abandon();
    target_m.value = null;
  };
  // SAFETY: Escape has stopped the robot already when it comes here; what was being moved is not sent afterwards.
  useCloseOnEscape(abandon);
  // SAFETY: neither is it when the mode, the control or the connection changes under the hand.
  useEffect(() => {
    if (reason) abandon();
    else complaint.value = '';
  }, [reason]);
  useEffect(() => abandon, [robot]);

  if (!ghost.is_moved) {
    const shown = [estimate_m, position_m, setpoint_m, rest_m].filter((value) => value !== null);
    range.current = next_range(range.current, Math.min(...shown, 0), Math.max(...shown, 0), kLeastSpan_m);
  }
  const places = new TubePlaces(range.current);
  const { from_m, to_m } = places;

  const move_to = (value_m: number) => {
    ghost.move(value_m, bounds);
    target_m.value = ghost.at_m;
  };
  const begin = () => {
    complaint.value = reason;
    if (reason || setpoint_m === null) return false;
    asking.clear();
    ghost.begin(setpoint_m);
    target_m.value = setpoint_m;
    return true;
  };
  const send = () => {
    const wanted_m = ghost.release();
    target_m.value = null;
    if (wanted_m === null) return;
    const { robot_id } = robot;
    void asking.ask(`Setpoint ${millimetres(wanted_m)} mm`, () => session.api.set_setpoint(robot_id, wanted_m));
  };
  const value_at = (client_x: number) => {
    const { left, width } = (tube.current as HTMLElement).getBoundingClientRect();
    return from_m + ((client_x - left) / width) * (to_m - from_m);
  };
  const on_key = (event: KeyboardEvent) => {
    const step_m = kKeys_m[event.key];
    if (step_m !== undefined) {
      event.preventDefault();
      if (!ghost.is_moved && !begin()) return;
      move_to((ghost.at_m ?? 0) + step_m * (event.shiftKey ? 10 : 1));
    } else if (event.key === 'Enter' && ghost.is_moved) {
      event.preventDefault();
      if (!event.repeat) send();
    }
  };
  const shown_m = target_m.value ?? setpoint_m;
  return (
    <section class={`vessel ${stale ? 'stale' : ''} ${reason ? '' : 'free'}`} aria-label="Where the robot is">
      <Tube host={tube} places={places} now={now} limits={known} rest_m={rest_m}>
        {shown_m !== null && (
          <div
            class={`ghost ${target_m.value === null ? '' : 'moved'}`}
            id="setpoint-ghost"
            style={{ left: places.at(shown_m) }}
            role="slider"
            tabIndex={0}
            aria-label="Setpoint. Arrow keys move it, Enter sends it"
            aria-valuemin={Math.round(m_to_millimetres(bounds.min_m))}
            aria-valuemax={Math.round(m_to_millimetres(bounds.max_m))}
            aria-valuenow={Math.round(m_to_millimetres(shown_m))}
            aria-valuetext={`${millimetres(shown_m)} millimetres`}
            aria-disabled={reason !== ''}
            aria-describedby="ghost-note"
            onPointerDown={(event) => {
              if (event.button !== 0 || !begin()) return;
              event.currentTarget.setPointerCapture(event.pointerId);
            }}
            onPointerMove={(event) =>
              event.currentTarget.hasPointerCapture(event.pointerId) && move_to(value_at(event.clientX))
            }
            onPointerUp={(event) => event.currentTarget.hasPointerCapture(event.pointerId) && send()}
            onPointerCancel={abandon}
            onLostPointerCapture={abandon}
            onBlur={abandon}
            onKeyDown={on_key}
          >
            {target_m.value !== null && <output>{millimetres(target_m.value, 0)}</output>}
          </div>
        )}
      </Tube>
      <Scale places={places} />
      <div class="vessel-foot">
        <span id="ghost-note" class={complaint.value ? 'caution' : ''} role={complaint.value ? 'status' : undefined}>
          {target_m.value !== null
            ? `Let go, or press Enter, to send ${millimetres(target_m.value, 0)} mm.`
            : complaint.value || reason || (asking.outcome.value.phase !== 'idle' ? '' : kHint)}
        </span>
        <OutcomeLine asking={asking} id="ghost-outcome" />
        {rest_m !== null && (
          <span class="rest-note">
            if stopped now, at rest near {millimetres(rest_m, 0)} mm{now.model && ` (${now.model})`}
          </span>
        )}
      </div>
    </section>
  );
}

// SAFETY: of a robot that is silent nothing is foretold.
export function resting_place(robot: Robot, coast: Coast | null): number | null {
  const { estimate_m, velocity_m_s, stale, watched } = robot.readout.value;
  if (!coast || stale || !watched || estimate_m === null || velocity_m_s === null) return null;
  const distance_m = coast.distance_m(robot.ring, velocity_m_s);
  return distance_m === null || Math.abs(distance_m) < kLeastCoast_m ? null : estimate_m + distance_m;
}

function circumstances(session: Session, robot: Robot) {
  const { link, control } = robot.state.value;
  const { mode, setpoint_m, stale } = robot.readout.value;
  return {
    is_current: session.store.is_current.value && session.phase.value === 'live',
    is_connected: link === 'connected',
    is_stale: stale,
    mode,
    has_setpoint: setpoint_m !== null,
    holder: control?.holder ?? null,
    actor: session.store.actor.value,
    may_command: session.me.value?.role !== 'viewer',
  };
}

// What may be asked for, as far as the page knows it; the station has the last word.
function bounds_of(session: Session, robot: Robot, known: Known): Bounds {
  const fluid = robot.state.value.fluid;
  const limits = session.fluids.value?.find((each) => each.fluid === fluid)?.limits;
  return {
    min_m: Math.max(known.position_min_m ?? -100, limits?.setpoint_min_m ?? -100),
    max_m: Math.min(known.position_max_m ?? 100, limits?.setpoint_max_m ?? 100),
  };
}

// Asked for when the robot is shown, and when it reports others.
function useKnown(session: Session, robot: Robot): Known {
  const known = useSignal<Known>(kNothingKnown);
  const { parameters_checksum, boot_id } = robot.state.value;
  const phase = session.phase.value;
  useEffect(() => {
    if (phase !== 'live') return;
    let is_wanted = true;
    known.value = kNothingKnown;
    const ask = () =>
      session.api.robot_parameters(robot.robot_id).then(
        (said) => {
          if (!is_wanted) return;
          known.value = known_of(said);
          // A robot that has just connected reports its parameters a moment later.
          if (!said.is_current) setTimeout(() => is_wanted && void ask(), 1000);
        },
        () => undefined,
      );
    void ask();
    return () => void (is_wanted = false);
  }, [robot, phase, parameters_checksum, boot_id]);
  return known.value;
}
