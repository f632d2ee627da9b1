// The station's figures in Prometheus' text format, as it serves them at /metrics.
//
//   rheonaut_emergency_stop_seconds_bucket{stage="acknowledged",le="0.005"} 12

const kLine = /^([a-zA-Z_:][\w:]*)(?:\{([^}]*)\})?\s+(\S+)$/;

export interface Spread {
  count: number;
  bound_s: number | null; // that the share stays within; null: it is beyond the last bound, or nothing was counted
}

export class Metrics {
  private readonly values = new Map<string, number>();

  constructor(text: string) {
    for (const line of text.split('\n')) {
      if (line.startsWith('#')) continue;
      const [, name, labels = '', value] = kLine.exec(line.trim()) ?? [];
      if (name !== undefined && Number.isFinite(Number(value))) this.values.set(`${name}{${labels}}`, Number(value));
    }
  }

  // null: this station does not have the figure.
  value(name: string, labels = ''): number | null {
    return this.values.get(`${name}{${labels}}`) ?? null;
  }

  // Over all labels; null: there is none.
  sum(name: string): number | null {
    const found = [...this.values].filter(([key]) => key.startsWith(`${name}{`)).map(([, value]) => value);
    return found.length === 0 ? null : found.reduce((sum, value) => sum + value, 0);
  }

  // The least bound of a histogram that `share` of what it counted lies within.
  within(name: string, labels: string, share: number): Spread {
    const count = this.value(`${name}_count`, labels) ?? 0;
    const start = `${name}_bucket{${labels},le="`;
    const bounds = [...this.values]
      .filter(([key]) => key.startsWith(start))
      .map(([key, below]) => ({ bound_s: Number(key.slice(start.length).split('"')[0]), below }))
      .sort((a, b) => a.bound_s - b.bound_s);
    const found = bounds.find(({ below }) => count > 0 && below >= share * count);
    return { count, bound_s: found && Number.isFinite(found.bound_s) ? found.bound_s : null };
  }
}
