// The strips of a scene under each other, with the hands on them.

import { useSignal } from '@preact/signals';
import { useEffect, useMemo, useRef } from 'preact/hooks';
import type { Scene } from './scene';
import { chosen_strips, kPredicted, type Strip } from './strips';

interface Props {
  scene: Scene;
  label: string; // of what keys do
  on_key(event: KeyboardEvent): boolean; // false: the key is none of ours
}

export function StripHost({ scene, label, on_key }: Props) {
  const host = useRef<HTMLDivElement>(null);
  const is_dragging = useSignal(false);
  const { traces, derived, is_utc } = scene.settings.kept.value;
  const strips = useMemo(() => chosen_strips(traces, derived), [traces, derived]);

  useEffect(() => scene.build(host.current as HTMLDivElement, strips, derived), [scene, strips]);
  useEffect(() => scene.redraw(), [scene, is_utc]);
  useEffect(() => {
    const strips_host = host.current as HTMLDivElement;
    const wheel = (event: WheelEvent) => {
      if (event.ctrlKey && event.deltaY === 0) return;
      event.preventDefault(); // which a passive listener may not
      scene.hand.wheel(event, x_in(event, strips_host));
    };
    strips_host.addEventListener('wheel', wheel, { passive: false });
    return () => strips_host.removeEventListener('wheel', wheel);
  }, [scene]);

  const up = (event: PointerEvent) => {
    scene.hand.up(event.pointerId);
    is_dragging.value = false;
  };
  return (
    <div
      class={`strips ${is_dragging.value ? 'dragging' : ''}`}
      ref={host}
      tabIndex={0}
      role="group"
      aria-label={label}
      onPointerDown={(event) => {
        if (event.button !== 0) return;
        event.currentTarget.setPointerCapture(event.pointerId);
        scene.hand.down(event.pointerId, x_in(event, event.currentTarget));
      }}
      onPointerMove={(event) => {
        scene.hand.move(event.pointerId, x_in(event, event.currentTarget));
        is_dragging.value = scene.hand.is_dragging;
      }}
      onPointerUp={up}
      onPointerCancel={up}
      onPointerLeave={() => scene.hand.leave()}
      onKeyDown={(event) => on_key(event) && event.preventDefault()}
    >
      {strips.map((strip, at) => (
        <StripFigure key={strip.name} strip={strip} at={at} is_last={at === strips.length - 1} scene={scene} />
      ))}
      <div class="cursor-line" hidden ref={(line) => void (scene.line = line)} />
    </div>
  );
}

const x_in = (event: MouseEvent, host: Element) => event.clientX - host.getBoundingClientRect().left;

function StripFigure({ strip, at, is_last, scene }: { strip: Strip; at: number; is_last: boolean; scene: Scene }) {
  const text = useSignal('');
  const cut = useSignal('');
  scene.texts.set(strip.name, text);
  scene.cuts.set(strip.name, cut);
  const traces = strip.traces.length > 1 || strip.name === 'position' ? [...strip.traces].reverse() : [];
  const keys = strip.has_predicted && scene.has_predicted.value ? [...traces, kPredicted] : traces;
  const name = strip.name.startsWith('=') ? 'derived' : strip.name;
  return (
    <figure class={`strip strip-${at} of-${name} ${strip.is_large ? 'large' : ''} ${is_last ? 'last' : ''}`}>
      <figcaption>
        <b>{strip.title}</b> <span class="unit">{strip.unit}</span>
        <span class="key">
          {keys.map((key) => (
            <span key={key.name} class={`swatch ${key.swatch}`}>
              {key.text}
            </span>
          ))}
        </span>
        <span class="band-cut">{cut}</span>
        <output class="cursor">{text}</output>
      </figcaption>
      <div class="plot" />
    </figure>
  );
}
