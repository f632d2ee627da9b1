// A plot of curves that have no time axis: Bode, Nyquist, the feasible region, predicted steps. Drawn as SVG, so that the
// style sheet colours it; its text keeps its size.

import { useSignal } from '@preact/signals';
import type { ComponentChildren } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { range_splits } from '../../range';

export interface Axis {
  from: number;
  to: number;
  is_log?: boolean;
  splits?: number[];
  text(value: number): string;
}

export interface Place {
  x(value: number): number;
  y(value: number): number;
  at_x(pixel: number): number;
  at_y(pixel: number): number;
  left: number;
  top: number;
  right: number;
  bottom: number;
}

export type GraphPoint = readonly [x: number, y: number];

const kLeft_px = 46;
const kRight_px = 10;
const kTop_px = 8;
const kBottom_px = 20;

const share = ({ from, to, is_log }: Axis, value: number) =>
  is_log ? Math.log(value / from) / Math.log(to / from) : (value - from) / (to - from);
const value_at = ({ from, to, is_log }: Axis, part: number) =>
  is_log ? from * (to / from) ** part : from + (to - from) * part;

export function place_of(x: Axis, y: Axis, width_px: number, height_px: number): Place {
  const [left, top, right, bottom] = [kLeft_px, kTop_px, width_px - kRight_px, height_px - kBottom_px];
  return {
    left,
    top,
    right,
    bottom,
    x: (value) => left + share(x, value) * (right - left),
    y: (value) => bottom - share(y, value) * (bottom - top),
    at_x: (pixel) => value_at(x, Math.min(1, Math.max(0, (pixel - left) / (right - left)))),
    at_y: (pixel) => value_at(y, Math.min(1, Math.max(0, (bottom - pixel) / (bottom - top)))),
  };
}

// Decades of a logarithmic axis, with 2 and 5 between them where there is room.
export function log_splits(from: number, to: number, is_dense: boolean): number[] {
  const leads = is_dense ? [1, 2, 5] : [1];
  const splits: number[] = [];
  for (let power = Math.floor(Math.log10(from)); power <= Math.ceil(Math.log10(to)); ++power) {
    for (const lead of leads) splits.push(Number((lead * 10 ** power).toPrecision(1)));
  }
  return splits.filter((value) => value >= from * (1 - 1e-9) && value <= to * (1 + 1e-9));
}

const splits_of = (axis: Axis) =>
  axis.splits ??
  (axis.is_log ? log_splits(axis.from, axis.to, axis.to / axis.from < 300) : range_splits([axis.from, axis.to]));

const kFar_px = 4000; // what lies further out is cut off there, so that no browser stumbles over it
const pixel = (value: number) => Math.max(-kFar_px, Math.min(kFar_px, value)).toFixed(1);

// Points that are not finite interrupt the line.
export function path_of(place: Place, points: readonly GraphPoint[]): string {
  let path = '';
  let is_on = false;
  for (const [x, y] of points) {
    const [px, py] = [place.x(x), place.y(y)];
    const is_there = Number.isFinite(px) && Number.isFinite(py);
    if (is_there) path += `${is_on ? 'L' : 'M'}${pixel(px)} ${pixel(py)}`;
    is_on = is_there;
  }
  return path;
}

interface GraphProps {
  id: string;
  label: string; // what is drawn, for a screen reader
  x: Axis;
  y: Axis;
  height_px: number;
  is_square?: boolean; // one unit is as long on both axes; y is widened or narrowed about its middle
  draw(place: Place): ComponentChildren;
  on_pick?(x: number, y: number, is_done: boolean): void; // pressed, dragged, let go
}

export function Graph({ id, label, x, y, height_px, is_square = false, draw, on_pick }: GraphProps) {
  const host = useRef<HTMLDivElement>(null);
  const width = useSignal(0);
  const is_dragged = useRef(false);
  useEffect(() => {
    const box = host.current;
    if (!box) return;
    const fit = () => (width.value = box.clientWidth);
    const observer = new ResizeObserver(fit);
    observer.observe(box);
    fit();
    return () => observer.disconnect();
  }, []);
  const width_px = width.value;
  const shown = is_square ? squared(x, y, width_px, height_px) : { x, y };
  const place = place_of(shown.x, shown.y, width_px, height_px);
  const pick = (event: PointerEvent, is_done: boolean) => {
    const box = host.current?.getBoundingClientRect();
    if (box) on_pick?.(place.at_x(event.clientX - box.left), place.at_y(event.clientY - box.top), is_done);
  };
  const clip = `${id}-clip`;
  return (
    <div
      class={`design-graph ${on_pick ? 'pickable' : ''}`}
      ref={host}
      id={id}
      onPointerDown={(event) => {
        if (!on_pick || event.button !== 0) return;
        event.currentTarget.setPointerCapture(event.pointerId);
        is_dragged.current = true;
        pick(event, false);
      }}
      onPointerMove={(event) => is_dragged.current && pick(event, false)}
      onPointerUp={(event) => {
        if (is_dragged.current) pick(event, true);
        is_dragged.current = false;
      }}
      onPointerCancel={() => (is_dragged.current = false)}
    >
      {width_px > 0 && (
        <svg width={width_px} height={height_px} viewBox={`0 0 ${width_px} ${height_px}`} role="img" aria-label={label}>
          <clipPath id={clip}>
            <rect
              x={place.left}
              y={place.top}
              width={Math.max(0, place.right - place.left)}
              height={place.bottom - place.top}
            />
          </clipPath>
          <Ticks place={place} x={shown.x} y={shown.y} />
          <g clip-path={`url(#${clip})`}>{draw(place)}</g>
        </svg>
      )}
    </div>
  );
}

function Ticks({ place, x, y }: { place: Place; x: Axis; y: Axis }) {
  return (
    <g class="design-ticks" aria-hidden="true">
      {splits_of(x).map((value) => (
        <g key={value}>
          <line x1={place.x(value)} x2={place.x(value)} y1={place.top} y2={place.bottom} />
          <text x={place.x(value)} y={place.bottom + 14} text-anchor="middle">
            {x.text(value)}
          </text>
        </g>
      ))}
      {splits_of(y).map((value) => (
        <g key={value}>
          <line x1={place.left} x2={place.right} y1={place.y(value)} y2={place.y(value)} />
          <text x={place.left - 7} y={place.y(value) + 4} text-anchor="end">
            {y.text(value)}
          </text>
        </g>
      ))}
    </g>
  );
}

function squared(x: Axis, y: Axis, width_px: number, height_px: number): { x: Axis; y: Axis } {
  const [wide_px, high_px] = [width_px - kLeft_px - kRight_px, height_px - kTop_px - kBottom_px];
  if (wide_px <= 0) return { x, y };
  const unit = Math.max((x.to - x.from) / wide_px, (y.to - y.from) / high_px);
  const spread = (axis: Axis, length_px: number): Axis => {
    const middle = (axis.from + axis.to) / 2;
    return { ...axis, from: middle - (unit * length_px) / 2, to: middle + (unit * length_px) / 2 };
  };
  return { x: spread(x, wide_px), y: spread(y, high_px) };
}
