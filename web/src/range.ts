// Ranges of scales with round ends.

// A range with round ends that holds [low, high] and does not tremble: it grows at once, and shrinks only when the data
// fill less than half of it.
export function next_range(now: [number, number], low: number, high: number, least_span: number): [number, number] {
  if (!(high >= low)) return now;
  const span = Math.max(high - low, least_span);
  const middle = (low + high) / 2;
  const fits = low >= now[0] && high <= now[1];
  if (fits && span * 1.08 > (now[1] - now[0]) / 2) return now;
  const step = round_step(span / 8);
  const pad = span * 0.04;
  const from = Math.floor((middle - span / 2 - pad) / step) * step;
  const to = Math.ceil((middle + span / 2 + pad) / step) * step;
  return [from, to];
}

// The round number (1, 2 or 5 times a power of ten) next above a rough step.
export function round_step(rough: number): number {
  const power = 10 ** Math.floor(Math.log10(rough));
  const lead = rough / power;
  return (lead <= 1 ? 1 : lead <= 2 ? 2 : lead <= 5 ? 5 : 10) * power;
}

export function range_splits([from, to]: [number, number]): number[] {
  const step = round_step((to - from) / 5);
  const first = Math.ceil(from / step - 1e-9);
  const last = Math.floor(to / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}
