// What is typed about a run is there again after another view, and gone once the station has it.
import { signal } from '@preact/signals';
import { h, render, type ComponentType } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Session } from '../../src/session';
import { NewMarker, Said } from '../../src/views/runs/record';
import type { RunPage } from '../../src/views/runs/run_page';
import type { Annotation } from '../../src/views/runs/runs_api';
import { fake_document, FakeNode } from '../fake_dom';
import { made_run } from './made';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const settle = () => vi.advanceTimersByTimeAsync(200);

async function record_of(Part: ComponentType<never>) {
  const session = {} as Session;
  const root = new FakeNode(1, 'body');
  const run = signal(made_run());
  const page = { run, picked_s: signal(1), markers: signal([]), origin_us: 0 } as unknown as RunPage;
  let answer = (change: Annotation) => Promise.resolve(made_run(change));
  const api = {
    annotate: (_: number, change: Annotation) => answer(change),
    add_marker: () => Promise.resolve(),
    markers: () => Promise.resolve([]),
  };
  const show = async (run_id = 1) => {
    render(null, root as unknown as Element);
    const props = { session, api, page, run: { ...run.value, run_id } };
    render(h(Part as ComponentType<object>, props), root as unknown as Element);
    await settle();
  };
  const type = async (id: string, value: string) => {
    root.find(id)!.fire('Input', { currentTarget: { value } });
    await settle();
  };
  const submit = async (id: string) => {
    let node = root.find(id);
    while (node && node.localName !== 'form') node = node.parentNode;
    node!.fire('Submit');
    await settle();
  };
  const value = (id: string) => root.find(id)!.attributes['value'] ?? '';
  await show();
  const answers = (next: typeof answer) => void (answer = next);
  return { show, type, submit, value, answers, page };
}

test('name, verdict and notes of a run are there again after another view, of this run alone', async () => {
  const { show, type, value } = await record_of(Said as ComponentType<never>);
  for (const id of ['said-name', 'said-verdict', 'said-notes']) await type(id, `half of ${id}`);
  await show(2);
  expect(value('said-notes')).toBe('');
  await show(1);
  for (const id of ['said-name', 'said-verdict', 'said-notes']) expect(value(id)).toBe(`half of ${id}`);
});

test('what the station has stored is no draft any more, and what it has refused is', async () => {
  const { show, type, submit, value, answers } = await record_of(Said as ComponentType<never>);
  await type('said-notes', 'warm');
  answers(() => Promise.reject(new Error('no')));
  await submit('said-notes');
  await show();
  expect(value('said-notes')).toBe('warm');
  answers((change) => Promise.resolve(made_run(change)));
  await submit('said-notes');
  await show(2);
  await show(1);
  expect(value('said-notes')).toBe('warm'); // of the run itself
  await type('said-notes', '');
  expect(value('said-notes')).toBe('');
});

test('what is typed while the station stores what was sent is kept', async () => {
  const { type, submit, value, answers } = await record_of(Said as ComponentType<never>);
  let store = () => undefined as void;
  answers((change) => new Promise((resolve) => (store = () => resolve(made_run(change)))));
  await type('said-notes', 'warm');
  await submit('said-notes');
  await type('said-notes', 'warm, and stirred');
  store();
  await settle();
  expect(value('said-notes')).toBe('warm, and stirred');
});

test('the text of a marker is there again, until the marker is put', async () => {
  const { show, type, submit, value, page } = await record_of(NewMarker as ComponentType<never>);
  await type('marker-text', 'at re');
  await show();
  expect(value('marker-text')).toBe('at re');
  await submit('marker-text');
  page.picked_s.value = 2;
  await show();
  expect(value('marker-text')).toBe('');
});
