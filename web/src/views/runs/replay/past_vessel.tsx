// The tube at a moment of a recorded run. Nothing in it can be moved.

import { useRef } from 'preact/hooks';
import { kLeastSpan_m, Scale, Tube, TubePlaces } from '../../../parts/tube';
import { next_range } from '../../../range';
import type { Readout } from '../../../robot';

const kNoLimits = { position_min_m: null, position_max_m: null }; // those in force then are not shown

export function PastVessel({ now }: { now: Readout }) {
  const range = useRef<[number, number]>([-0.05, 0.25]);
  const { estimate_m, position_m, setpoint_m, stale } = now;
  const shown = [estimate_m, position_m, setpoint_m].filter((value) => value !== null);
  range.current = next_range(range.current, Math.min(...shown, 0), Math.max(...shown, 0), kLeastSpan_m);
  const places = new TubePlaces(range.current);
  return (
    <section class={`vessel ${stale ? 'stale' : ''}`} aria-label="Where the robot was">
      <Tube places={places} now={now} limits={kNoLimits} rest_m={null} />
      <Scale places={places} />
    </section>
  );
}
