// The live link: how it notices a dead connection, and how it comes back.
import { expect, test } from 'vitest';
import { kCurrent_ms, kFirstDelay_ms, kLongestDelay_ms, kSignedOut_ms, kSilence_ms, LiveLink } from '../src/live';
import { FakeSurroundings } from './fakes';

function started(): { around: FakeSurroundings; link: LiveLink; received: string[] } {
  const around = new FakeSurroundings();
  const received: string[] = [];
  const link = new LiveLink(
    around,
    (message) => received.push(message.type),
    () => undefined,
  );
  link.start();
  return { around, link, received };
}

test('is live once it was welcomed, not before', () => {
  const { around, link } = started();
  expect(link.phase).toBe('connecting');
  around.socket.welcome();
  expect(link.phase).toBe('live');
});

test('a closed connection is opened again after 0.3 s', async () => {
  const { around, link } = started();
  around.socket.welcome();
  around.socket.break();
  expect(link.phase).toBe('waiting');
  await around.time.advance(kFirstDelay_ms);
  expect(around.sockets).toHaveLength(2);
  around.socket.welcome();
  expect(link.phase).toBe('live');
});

test('delays grow to 2 s and stay there, whatever the jitter', async () => {
  for (const chance of [0, 0.5, 0.999]) {
    const { around } = started();
    around.chance = chance;
    const delays_ms: number[] = [];
    for (let i = 0; i < 12; ++i) {
      around.socket.break();
      const delay_ms = around.time.waiting_ms[0] ?? NaN;
      delays_ms.push(delay_ms);
      await around.time.advance(delay_ms);
    }
    expect(Math.min(...delays_ms)).toBeGreaterThanOrEqual(kFirstDelay_ms);
    expect(Math.max(...delays_ms)).toBeLessThanOrEqual(kLongestDelay_ms + 1e-6);
    expect(delays_ms[11]).toBeGreaterThan(delays_ms[0] ?? NaN);
  }
});

test('silence for 1.5 s is a lost connection, even if TCP says nothing', async () => {
  const { around, link } = started();
  around.socket.welcome();
  const first = around.socket;
  for (let i = 0; i < 20; ++i) {
    await around.time.advance(100);
    first.say({ type: 'stamp', stamp_us: i });
  }
  expect(link.phase).toBe('live');
  await around.time.advance(kSilence_ms);
  expect(link.phase).toBe('waiting');
  expect(first.closed).toBe(true);
  expect(link.lost_at_ms).toBe(2000); // when the last message came
});

test('a connection that is never welcomed is given up', async () => {
  const { around } = started();
  await around.time.advance(3000 + kFirstDelay_ms);
  expect(around.sockets).toHaveLength(2);
});

test('401 ends the trying until the link was opened; any other failure does not', async () => {
  const { around, link } = started();
  around.socket.break();
  await around.time.advance(10_000);
  expect(link.phase).not.toBe('signed_out');
  around.signed_out = true;
  around.socket.break();
  await around.time.advance(0);
  expect(link.phase).toBe('signed_out');
  const tried = around.sockets.length;
  await around.time.advance(60_000);
  expect(around.sockets).toHaveLength(tried);
  around.signed_out = false; // the link was opened in another tab
  await around.time.advance(kSignedOut_ms);
  around.socket.welcome();
  expect(link.phase).toBe('live');
});

test('a stamp is fresh for 400 ms and only on the connection that brought it', async () => {
  const { around, link } = started();
  around.socket.welcome();
  expect(link.stamp_is_fresh()).toBe(false);
  around.socket.say({ type: 'stamp', stamp_us: 5 });
  expect(link.stamp_is_fresh()).toBe(true);
  await around.time.advance(400);
  expect(link.stamp_is_fresh()).toBe(false);
  around.socket.say({ type: 'stamp', stamp_us: 6 });
  around.socket.break();
  expect(link.stamp_is_fresh()).toBe(false);
  expect(link.stamp_us).toBeNull();
});

test('what the page shows is current for a second after a stamp', async () => {
  const { around, link } = started();
  around.socket.welcome();
  expect(link.is_current()).toBe(false);
  around.socket.say({ type: 'stamp', stamp_us: 5 });
  expect(link.is_current()).toBe(true);
  await around.time.advance(kCurrent_ms);
  expect(link.is_current()).toBe(false);
  around.socket.say({ type: 'stamp', stamp_us: 6 });
  around.socket.break();
  expect(link.is_current()).toBe(false);
});

test('a message that is no JSON does not end the connection', () => {
  const { around, link, received } = started();
  around.socket.welcome();
  around.socket.onmessage?.({ data: '{"type":' } as never);
  around.socket.say({ type: 'stamp', stamp_us: 1 });
  expect(link.phase).toBe('live');
  expect(received).toEqual(['welcome', 'stamp']);
});

test('messages of a connection that was given up are ignored', async () => {
  const { around, received } = started();
  const first = around.socket;
  first.welcome();
  await around.time.advance(kSilence_ms + kFirstDelay_ms);
  first.say({ type: 'stamp', stamp_us: 1 });
  expect(received).toEqual(['welcome']);
});

test('send returns whether this connection is open', () => {
  const { around, link } = started();
  expect(link.send({ type: 'keep_alive' })).toBe(false);
  around.socket.welcome();
  expect(link.send({ type: 'emergency_stop', robot_id: null })).toBe(true);
  expect(around.socket.sent).toEqual([{ type: 'emergency_stop', robot_id: null }]);
});

test('a page that wakes up does not wait for its turn', async () => {
  const { around, link } = started();
  around.socket.break();
  link.hurry();
  expect(around.sockets).toHaveLength(2);
});
