// Ranges of scales with round ends, and how much of a band they show.

export type Extent = [number, number]; // least and largest value; the least is the larger one where there is none

const kMostSpans = 5; // of the traces, that a range with a band has at most

// What a range holds of traces and of the band of ± 2 sd around them. A band that the axis cuts off looks smaller than it
// is, or one-sided, so that the range follows it as well. But one that is huge, as at the end of a long drive by hand,
// would flatten the traces to a line: they keep a fifth of the height, and the plot says in words that the band is cut.
export function with_band(traces: Extent, band: Extent, least_span: number): Extent {
  const beside = ((kMostSpans - 1) / 2) * Math.max(traces[1] - traces[0], least_span);
  if (!(traces[1] >= traces[0]) || !(band[1] >= band[0])) return traces;
  return [
    Math.min(traces[0], Math.max(band[0], traces[0] - beside)),
    Math.max(traces[1], Math.min(band[1], traces[1] + beside)),
  ];
}

export const is_cut = (range: Extent, band: Extent) => band[0] < range[0] || band[1] > range[1];

export const kNoExtent: Extent = [Infinity, -Infinity];

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
