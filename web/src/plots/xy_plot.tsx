// Any channel against any other, of the time that the plots show: below them, when somebody has opened it.

import { useSignal } from '@preact/signals';
import { useEffect, useRef } from 'preact/hooks';
import { count, plus_minus } from '../format';
import { Choice } from '../parts/choice';
import { next_range } from '../range';
import type { Scene } from './scene';
import { channels_of, look_of_any } from './strips';
import { kMostPoints, XyPoints } from './xy';
import { paint_xy } from './xy_painter';

const kAgain_ms = 95; // between two drawings while the plots run
const kAgainLong_ms = 490; // of many points

export function XyPlot({ scene }: { scene: Scene }) {
  return scene.settings.kept.value.xy.is_open ? <OpenXyPlot scene={scene} /> : null;
}

function OpenXyPlot({ scene }: { scene: Scene }) {
  const { settings } = scene;
  const { xy, derived } = settings.kept.value;
  const canvas = useRef<HTMLCanvasElement>(null);
  const note = useSignal('');
  const [x_look, y_look] = [look_of_any(xy.x, derived), look_of_any(xy.y, derived)];
  const channels = channels_of(derived);
  const name = (column: string) => channels.find((each) => each.column === column)?.text ?? column;

  useEffect(() => {
    const host = canvas.current as HTMLCanvasElement;
    const context = host.getContext('2d') as CanvasRenderingContext2D;
    const points = new XyPoints();
    const ranges: { x: [number, number]; y: [number, number] } = { x: [0, 0], y: [0, 0] };
    let drawn_at_ms = -Infinity;
    let timer = 0;
    const draw = () => {
      drawn_at_ms = performance.now();
      const ratio = devicePixelRatio;
      const [width, height] = [host.clientWidth, host.clientHeight].map((size) => Math.round(size * ratio)) as [
        number,
        number,
      ];
      if (host.width !== width || host.height !== height) [host.width, host.height] = [width, height];
      const { past } = scene.source;
      points.fill({ rows: scene.rows, shift_s: scene.source.shift_s(), past }, scene.view, xy.x, xy.y);
      past.end(); // what it lacks of the past is asked for
      ranges.x = next_range(ranges.x, ...points.x_range, x_look.least_span ?? 1);
      ranges.y = next_range(ranges.y, ...points.y_range, y_look.least_span ?? 1);
      const style = getComputedStyle(host);
      const colour = (token: string) => style.getPropertyValue(token).trim();
      paint_xy(context, points, {
        width,
        height,
        ratio,
        x_range: ranges.x[1] > ranges.x[0] ? ranges.x : [-1, 1],
        y_range: ranges.y[1] > ranges.y[0] ? ranges.y : [-1, 1],
        x_label: x_look.label,
        y_label: y_look.label,
        x_title: `${name(xy.x)}, ${x_look.unit}`,
        y_title: `${name(xy.y)}, ${y_look.unit}`,
        colours: {
          graticule: colour('--graticule'),
          muted: colour('--muted'),
          trace: colour('--measured'),
          plot: colour('--plot'),
          font: colour('--numerals'),
        },
      });
      note.value = note_of(points, [xy.x, xy.y]);
    };
    // With the strips, but not as often; the last change is drawn for certain.
    const follow = () => {
      const again_ms = points.size > 20_000 ? kAgainLong_ms : kAgain_ms;
      const wait_ms = drawn_at_ms + again_ms - performance.now();
      if (wait_ms <= 0) draw();
      else if (timer === 0) timer = window.setTimeout(() => ((timer = 0), draw()), wait_ms);
    };
    draw();
    scene.drawn.add(follow);
    const observer = new ResizeObserver(draw);
    observer.observe(host);
    const theme = matchMedia('(prefers-color-scheme: light)');
    theme.addEventListener('change', draw);
    return () => {
      scene.drawn.delete(follow);
      clearTimeout(timer);
      observer.disconnect();
      theme.removeEventListener('change', draw);
    };
  }, [scene, xy.x, xy.y, derived]);

  const options = channels.map(({ column, text }) => ({ value: column, text }));
  return (
    <figure class="xy" id="xy-plot">
      <figcaption>
        <b>X–Y</b>
        <Choice
          id="xy-y"
          label="Upward"
          options={options}
          value={xy.y}
          on_choose={(y) => settings.change({ xy: { ...xy, y: y as typeof xy.y } })}
        />
        <span class="quiet">against</span>
        <Choice
          id="xy-x"
          label="To the right"
          options={options}
          value={xy.x}
          on_choose={(x) => settings.change({ xy: { ...xy, x: x as typeof xy.x } })}
        />
        <output class="quiet" id="xy-note">
          {note}
        </output>
      </figcaption>
      <canvas ref={canvas} role="img" aria-label={`${name(xy.y)} against ${name(xy.x)}`} />
    </figure>
  );
}

// A position is an estimate: what is drawn of it, or computed from it, is not surer than that.
export function note_of({ size, is_cut, most_sd_m }: XyPoints, columns: readonly string[]): string {
  if (size === 0) return 'No sample with both values in the time shown.';
  const is_estimate = columns.some((name) => /estimate_m|position_m/.test(name));
  const sd_m = Number.isNaN(most_sd_m) ? null : most_sd_m;
  const spread = is_estimate ? ` The position is ${plus_minus(sd_m)} mm (2 sd, the largest).` : '';
  if (is_cut) return `${count(size)} samples: the newest of the time shown, at most ${count(kMostPoints)}.${spread}`;
  return `${count(size)} ${size === 1 ? 'sample' : 'samples'} of the time shown, the newest in the ring.${spread}`;
}
