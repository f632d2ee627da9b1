// The drawn tube: where the robot believes to be with its "±", the setpoint and the reference, position limits, and where
// it would come to rest. What can be moved in it is handed in; by itself it commands nothing.

import type { ComponentChildren, RefObject } from 'preact';
import { kSpread_sd, millimetres } from '../format';
import { range_splits, round_step } from '../range';
import type { Readout } from '../robot';
import type { Known } from '../vessel/coast';

export const kLeastSpan_m = 0.3;

// Where in the width of the tube a position lies.
export class TubePlaces {
  readonly from_m: number;
  readonly to_m: number;

  constructor([from_m, to_m]: readonly [number, number]) {
    [this.from_m, this.to_m] = [from_m, to_m];
  }

  at(value_m: number): string {
    const share = (value_m - this.from_m) / (this.to_m - this.from_m);
    return `${(Math.max(0, Math.min(1, share)) * 100).toFixed(3)}%`;
  }
}

interface TubeProps {
  host?: RefObject<HTMLDivElement>;
  places: TubePlaces;
  now: Pick<Readout, 'estimate_m' | 'position_m' | 'position_sd_m' | 'setpoint_m' | 'reference_m'>;
  limits: Pick<Known, 'position_min_m' | 'position_max_m'>;
  rest_m: number | null;
  children?: ComponentChildren;
}

export function Tube({ host, places, now, limits, rest_m, children }: TubeProps) {
  const { estimate_m, position_m, position_sd_m, setpoint_m, reference_m } = now;
  const spread_m = kSpread_sd * (position_sd_m ?? 0);
  return (
    <div class="tube" {...(host ? { ref: host } : {})} title="One tube, open at both ends; the robot is not to scale">
      <Limit at_m={limits.position_min_m} side="low" places={places} />
      <Limit at_m={limits.position_max_m} side="high" places={places} />
      {estimate_m !== null && spread_m > 0 && (
        <u
          style={{ left: places.at(estimate_m - spread_m), right: `calc(100% - ${places.at(estimate_m + spread_m)})` }}
        />
      )}
      {reference_m !== null && setpoint_m !== null && <i class="reference" style={{ left: places.at(reference_m) }} />}
      {setpoint_m !== null && <i class="in-force" style={{ left: places.at(setpoint_m) }} />}
      {position_m !== null && position_m !== estimate_m && <i class="seen" style={{ left: places.at(position_m) }} />}
      {rest_m !== null && <Swimmer class="rest" left={places.at(rest_m)} />}
      {estimate_m !== null && <Swimmer class="here" left={places.at(estimate_m)} />}
      {children}
    </div>
  );
}

interface LimitProps {
  at_m: number | null;
  side: 'low' | 'high';
  places: TubePlaces;
}

// A wall where motion ends in an emergency; out of sight it is named at the end of the tube.
function Limit({ at_m, side, places }: LimitProps) {
  const { from_m, to_m } = places;
  if (at_m === null) return null;
  const is_out = at_m < from_m || at_m > to_m;
  if (is_out) return <span class={`limit-out ${side}`}>limit {millimetres(at_m, 0)}</span>;
  const style = side === 'low' ? { right: `calc(100% - ${places.at(at_m)})` } : { left: places.at(at_m) };
  return <span class={`limit ${side}`} style={style} title={`Position limit ${millimetres(at_m, 0)} mm`} />;
}

const Swimmer = ({ class: name, left }: { class: string; left: string }) => (
  <svg class={`swimmer ${name}`} style={{ left }} viewBox="-22 -11 44 22" aria-hidden="true">
    <path d="M-21 0q4 -7 8 0t8 0" />
    <rect x="-6" y="-6" width="25" height="12" rx="6" />
    <line x1="0" y1="-11" x2="0" y2="11" />
  </svg>
);

export function Scale({ places }: { places: TubePlaces }) {
  const { from_m, to_m } = places;
  const step_m = round_step((to_m - from_m) / 5) / 5;
  const minor = Array.from({ length: Math.floor((to_m - from_m) / step_m) + 1 }, (_, i) => from_m + i * step_m);
  return (
    <div class="vessel-scale" aria-hidden="true">
      {minor.map((value_m) => (
        <s key={value_m} style={{ left: places.at(value_m) }} />
      ))}
      {range_splits([from_m, to_m]).map((value_m) => (
        <b key={value_m} style={{ left: places.at(value_m) }}>
          <span>{millimetres(value_m, 0)}</span>
        </b>
      ))}
    </div>
  );
}
