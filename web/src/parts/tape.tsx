// A horizontal scale as on an altimeter tape: ticks, the robot as a pointer, reference and setpoint as bugs.

import { useRef } from 'preact/hooks';
import { next_range, range_splits, round_step } from '../range';
import { kSpread_sd, m_to_millimetres } from '../format';
import type { Robot } from '../robot';

const kLeastSpan_m = 0.24;

export function Tape({ robot }: { robot: Robot }) {
  const { estimate_m, position_m, position_sd_m, setpoint_m, reference_m } = robot.readout.value;
  const range = useRef<[number, number]>([-0.02, 0.22]);
  const spread_m = kSpread_sd * (position_sd_m ?? 0);
  const shown = [estimate_m, position_m, setpoint_m].filter((value) => value !== null);
  const [low, high] = [Math.min(...shown, 0), Math.max(...shown, 0)];
  range.current = next_range(range.current, low, high, kLeastSpan_m);
  const [from, to] = range.current;
  const place = (value_m: number) => `${(Math.max(0, Math.min(1, (value_m - from) / (to - from))) * 100).toFixed(3)}%`;
  const major = range_splits(range.current);
  const step = round_step((to - from) / 5) / 5;
  const minor = Array.from({ length: Math.floor((to - from) / step) + 1 }, (_, i) => from + i * step);
  return (
    <div class="tape" aria-hidden="true">
      <div class="ticks">
        {minor.map((value_m) => (
          <s key={value_m} style={{ left: place(value_m) }} />
        ))}
        {major.map((value_m) => (
          <b key={value_m} style={{ left: place(value_m) }}>
            <span>{Math.round(m_to_millimetres(value_m))}</span>
          </b>
        ))}
      </div>
      {reference_m !== null && setpoint_m !== null && <i class="reference" style={{ left: place(reference_m) }} />}
      {setpoint_m !== null && <i class="setpoint-bug" style={{ left: place(setpoint_m) }} />}
      {estimate_m !== null && spread_m > 0 && (
        <u style={{ left: place(estimate_m - spread_m), right: `calc(100% - ${place(estimate_m + spread_m)})` }} />
      )}
      {position_m !== null && position_m !== estimate_m && <i class="seen" style={{ left: place(position_m) }} />}
      {estimate_m !== null && <i class="pointer" style={{ left: place(estimate_m) }} />}
    </div>
  );
}
