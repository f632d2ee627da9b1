// The window of an identification: what was typed wrong is said, and nothing is fitted with it.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { route } from '../../src/route';
import { kLimit, kNothing, parse_design } from '../../src/views/design/address';
import { IdentifyStep } from '../../src/views/design/identify_step';
import type { StepProps } from '../../src/views/design/parts';
import { times_of } from '../../src/views/design/typed_times';
import { fake_document, FakeNode } from '../fake_dom';

const kEmpty = { from: '', to: '', limit: '' };

test('empty fields are the whole run and the usual limit; a comma is a point', () => {
  expect(times_of(kEmpty)).toEqual({ from_s: 0, to_s: null, limit_s: kLimit.usual });
  expect(times_of({ from: ' 1,5 ', to: '8', limit: '6' })).toEqual({ from_s: 1.5, to_s: 8, limit_s: 6 });
});

test('what is wrong is said in words, with its field', () => {
  expect(times_of({ ...kEmpty, from: 'abc' })).toEqual({
    field: 'from',
    text: 'From: “abc” is not a number of seconds.',
  });
  expect(times_of({ ...kEmpty, to: '-1' })).toMatchObject({ field: 'to' });
  expect(times_of({ ...kEmpty, limit: '601' })).toMatchObject({ field: 'limit' });
  for (const to of ['20', '5']) expect(times_of({ ...kEmpty, from: '20', to })).toMatchObject({ field: 'to' });
  expect(times_of({ ...kEmpty, to: '0' }), 'nothing is left of the run').toMatchObject({ field: 'to' });
});

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', { ...fake_document, addEventListener() {}, removeEventListener() {} });
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('location', { hash: '' });
  vi.stubGlobal('history', { pushState() {}, replaceState() {} });
  for (const name of ['addEventListener', 'removeEventListener']) vi.stubGlobal(name, () => undefined);
});
const pages: FakeNode[] = [];
afterEach(async () => {
  for (const page of pages.splice(0)) render(null, page as unknown as Element);
  route.value = { view: 'robot', parts: [], query: {} };
  await vi.advanceTimersByTimeAsync(200); // what a part still has to do after it was drawn
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

async function step() {
  const asked: unknown[] = [];
  const answer = { phase: 'idle', key: '', job_id: null, result: null, share: null, stage: '', error: '' };
  const work = { fit: { answer: signal(answer), ask: (_: string, body: unknown) => asked.push(body) } };
  const session = { phase: signal('live'), me: signal({ scopes: 'record' }) };
  const page = new FakeNode(1, 'body');
  pages.push(page);
  route.value = { view: 'design', parts: [], query: { runs: '3', from: '10', to: '20' } };
  const Part = () => {
    const design = { ...kNothing, ...parse_design(route.value.query) };
    const props = { session, work: { ...work, states: signal({}) }, design, runs: { answer: null, problem: '' } };
    return h(IdentifyStep, props as unknown as StepProps);
  };
  render(h(Part, {}), page as unknown as Element);
  const settle = () => vi.advanceTimersByTimeAsync(200);
  const type = async (id: string, value: string) => {
    page.find(id)!.fire('Input', { currentTarget: { value } });
    await settle();
    page.find(id)!.fire('Change', { currentTarget: { value } });
    await settle();
  };
  await settle();
  const button = () => page.find('design-identify')!;
  return { page, asked, type, button, problem: () => page.find('design-times-problem')!.text };
}

test('a time that is no number disables the button, and is not replaced by what was there before', async () => {
  const { page, type, button, problem } = await step();
  expect('disabled' in button().attributes).toBe(false);
  await type('design-to', 'abc');
  expect('disabled' in button().attributes).toBe(true);
  expect(problem()).toBe('To: “abc” is not a number of seconds.');
  expect(page.find('design-to')!.attributes['aria-invalid']).toBe('true');
  expect(route.value.query['to']).toBe('20');
  await type('design-to', '25');
  expect('disabled' in button().attributes).toBe(false);
  expect(problem()).toBe('');
  expect(route.value.query['to']).toBe('25');
});

test('a window that ends before it begins is not fitted; both of its ends are taken when they are right', async () => {
  const { asked, type, button, problem } = await step();
  await type('design-from', '30');
  expect(problem()).toBe('To: it must be later than From.');
  expect('disabled' in button().attributes).toBe(true);
  await type('design-to', '40');
  expect(problem()).toBe('');
  button().fire('Click');
  expect(asked).toEqual([expect.objectContaining({ run_id: 3, from_s: 30, to_s: 40 })]);
});

test('what is being typed in one field outlives that another one is taken', async () => {
  const { page, type } = await step();
  page.find('design-limit')!.fire('Input', { currentTarget: { value: '6' } });
  await type('design-to', '25');
  expect(page.find('design-limit')!.attributes['value']).toBe('6');
  page.find('design-limit')!.fire('Input', { currentTarget: { value: 'x' } });
  await type('design-to', '26');
  expect(page.find('design-limit')!.attributes['value']).toBe('x');
});
