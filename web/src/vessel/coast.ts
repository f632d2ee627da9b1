// How far a robot would coast if its motor were turned off now, by the model that its own estimator has.
//
//   v_i' = (g_i · duty − v_i) / T_i,   i = 1 … 4        from there, with duty 0:   distance = Σ v_i · T_i
//
// The shares v_i follow from the duty that was received; their sum is laid on the velocity that the robot reports. After
// a gap they are taken as those of a long drive, which coasts furthest. It is as good as the model, and no better.

import type { ParametersInForce } from '../api';
import type { SampleRing } from '../samples';

export interface VelocityModel {
  gain_m_s: number[];
  time_constant_s: number[];
  dead_zone_duty: number;
}

// What the page takes of a robot's parameters; null: not known.
export interface Known {
  position_min_m: number | null;
  position_max_m: number | null;
  model: VelocityModel | null;
}

export const kNothingKnown: Known = { position_min_m: null, position_max_m: null, model: null };
const kUnlimited_m = 100; // the default of a position limit: none

export function known_of({ parameters }: Pick<ParametersInForce, 'parameters'>): Known {
  const values = new Map((parameters ?? []).map(({ name, value }) => [name, value]));
  const value = (name: string) => values.get(name) ?? null;
  const limit = (name: string) => {
    const at_m = value(name);
    return at_m === null || Math.abs(at_m) >= kUnlimited_m ? null : at_m;
  };
  const four = (name: (i: number) => string) => [1, 2, 3, 4].map((i) => value(name(i)));
  const gain_m_s = four((i) => `model_gain_${i}_m_s`);
  const time_constant_s = four((i) => `model_time_constant_${i}_s`);
  const is_known = [...gain_m_s, ...time_constant_s].every((each) => each !== null);
  return {
    position_min_m: limit('position_limit_min_m'),
    position_max_m: limit('position_limit_max_m'),
    model: is_known
      ? {
          gain_m_s: gain_m_s as number[],
          time_constant_s: time_constant_s as number[],
          dead_zone_duty: value('dead_zone_duty') ?? 0,
        }
      : null,
  };
}

const kLeastSpeed_m_s = 0.002; // below it no model is laid on the velocity
const kMostCorrection = 2;

export class Coast {
  private readonly share_m_s: number[];
  private next_index = -1; // of the ring, after the latest sample that was counted

  constructor(private readonly model: VelocityModel) {
    this.share_m_s = model.gain_m_s.map(() => 0);
  }

  // From the newest sample on; null while there is none.
  distance_m(ring: SampleRing, velocity_m_s: number): number | null {
    this.follow(ring);
    if (this.next_index < 0) return null;
    const { time_constant_s } = this.model;
    const sum_m_s = this.share_m_s.reduce((sum, each) => sum + each, 0);
    const distance_m = this.share_m_s.reduce((sum, each, i) => sum + each * (time_constant_s[i] as number), 0);
    if (Math.abs(sum_m_s) < kLeastSpeed_m_s || Math.abs(velocity_m_s) < kLeastSpeed_m_s) return distance_m;
    const correction = Math.max(1 / kMostCorrection, Math.min(kMostCorrection, velocity_m_s / sum_m_s));
    return distance_m * correction;
  }

  private follow(ring: SampleRing): void {
    const { gain_m_s, time_constant_s, dead_zone_duty } = this.model;
    const kept = time_constant_s.map((constant_s) => Math.exp(-ring.period_s / constant_s));
    for (let index = Math.max(this.next_index, ring.first_index); index < ring.next_index; ++index) {
      if (!ring.holds(index)) continue;
      const slot = index % ring.capacity;
      if (index !== this.next_index) this.begin_anew(ring.columns.velocity_m_s[slot] as number);
      const said = ring.columns.duty[slot] as number;
      const duty = Number.isFinite(said) && Math.abs(said) > dead_zone_duty ? said : 0;
      this.share_m_s.forEach((share, i) => {
        const keep = kept[i] as number;
        this.share_m_s[i] = keep * share + (1 - keep) * (gain_m_s[i] as number) * duty;
      });
      this.next_index = index + 1;
    }
  }

  private begin_anew(velocity_m_s: number): void {
    const total = this.model.gain_m_s.reduce((sum, each) => sum + each, 0);
    const known_m_s = Number.isFinite(velocity_m_s) && total !== 0 ? velocity_m_s : 0;
    this.model.gain_m_s.forEach((gain, i) => (this.share_m_s[i] = total === 0 ? 0 : (known_m_s * gain) / total));
  }
}
