// The button that gives up what is missing of a run: for how many samples it is, and what becomes of them.
import { signal } from '@preact/signals';
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { kGuard_ms } from '../../src/parts/hold_button';
import { GiveUp } from '../../src/views/runs/record';
import type { RunPage } from '../../src/views/runs/run_page';
import type { Certificate, RunsApi } from '../../src/views/runs/runs_api';
import { fake_document, FakeNode } from '../fake_dom';
import { made_run } from './made';

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('document', fake_document);
  vi.stubGlobal('window', { setTimeout });
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const said = (final: boolean, samples_missing: number) => ({ final, samples_missing }) as Certificate;

async function shown(api: Partial<RunsApi>, certificate: Certificate) {
  const page = { certificate: signal<Certificate | null>(certificate) } as unknown as RunPage;
  const root = new FakeNode(1, 'div');
  const draw = async () => {
    render(h(GiveUp, { api: api as RunsApi, page, run: made_run() }), root as unknown as HTMLElement);
    await vi.advanceTimersByTimeAsync(0);
  };
  const hold = async (for_ms: number) => {
    root.find('give-up')?.fire('PointerDown', { pointerId: 1 });
    await vi.advanceTimersByTimeAsync(for_ms);
    root.find('give-up')?.fire('PointerUp');
    await draw();
  };
  await draw();
  return { page, root, hold };
}

test('it says how many samples it gives up, gives up that number, and only when it is held', async () => {
  const finalize = vi.fn(async () => said(true, 0));
  const { page, root, hold } = await shown({ finalize } as unknown as RunsApi, said(false, 20));
  expect(root.find('give-up')?.text).toBe('Hold to give up 20 samples');
  await hold(kGuard_ms / 2);
  expect(finalize).not.toHaveBeenCalled();
  await hold(kGuard_ms);
  expect(finalize).toHaveBeenCalledWith(1, 20);
  expect(page.certificate.value?.final).toBe(true);
  expect(root.find('give-up')).toBeNull();
});

test('when another number is missing meanwhile, that is shown, and nothing is given up', async () => {
  const refused = {
    finalize: () => Promise.reject(new Error('21 samples are missing now')),
    certificate: async () => said(false, 21),
  };
  const { root, hold } = await shown(refused as unknown as RunsApi, said(false, 20));
  await hold(kGuard_ms);
  expect(root.find('give-up-outcome')?.text).toBe('21 samples are missing now');
  expect(root.find('give-up')?.text).toBe('Hold to give up 21 samples');
});

test('a run of which nothing is missing has no such button', async () => {
  const { root } = await shown({}, said(true, 0));
  expect(root.text).toBe('');
});
