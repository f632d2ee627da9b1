// What is asked of the station again and again: one look at a time, and the next when it is worth it.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Session } from '../../src/session';
import { useAsked } from '../../src/views/experiments/acts';
import { fake_document, FakeNode } from '../fake_dom';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

// A page that shows what was answered; `answer` gives the answer to the look that was asked as the n-th.
function page_that_asks(every_ms: number | ((answer: string | null) => number)) {
  const session = { phase: signal('live') } as unknown as Session;
  const looks: ((answer: string) => void)[] = [];
  const ask = () => new Promise<string>((resolve) => looks.push(resolve));
  const Shown = () => h('p', null, useAsked(session, ask, [], every_ms).answer);
  const page = new FakeNode(1, 'body');
  render(h(Shown, {}), page as unknown as Element);
  const answer = async (at: number, text: string) => {
    looks[at]!(text);
    await vi.advanceTimersByTimeAsync(100);
  };
  return { page, looks, answer };
}

test('nothing is asked again before the last look has its answer', async () => {
  const { page, looks, answer } = page_that_asks(1000);
  await vi.advanceTimersByTimeAsync(5000);
  expect(looks).toHaveLength(1);
  await answer(0, 'first');
  expect(page.text).toBe('first');
  await vi.advanceTimersByTimeAsync(1000);
  expect(looks).toHaveLength(2);
  await answer(1, 'second');
  expect(page.text).toBe('second');
});

test('an answer that is not final is asked for again, and the final one is not', async () => {
  const { page, looks, answer } = page_that_asks((said) => (said === 'final' ? 0 : 1000));
  await vi.advanceTimersByTimeAsync(100);
  await answer(0, 'not yet');
  await vi.advanceTimersByTimeAsync(1000);
  await answer(1, 'final');
  await vi.advanceTimersByTimeAsync(10_000);
  expect(looks).toHaveLength(2);
  expect(page.text).toBe('final');
});
