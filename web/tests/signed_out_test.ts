// What the page says to a browser that is not signed in: without a link, and with one that is no longer valid.
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Session } from '../src/session';
import { SignedOut } from '../src/views/signed_out';
import { fake_document, FakeNode } from './fake_dom';

beforeEach(() => vi.stubGlobal('document', fake_document));
afterEach(() => vi.unstubAllGlobals());

function drawn_at(pathname: string): string {
  vi.stubGlobal('location', { origin: 'http://lab:8080', pathname });
  const page = new FakeNode(1, 'body');
  render(h(SignedOut, { session: {} as Session }), page as unknown as Element);
  return page.text;
}

test('without a link it says where the station has printed one, and how another is made', () => {
  const text = drawn_at('/');
  expect(text).toContain('Open the link that the station printed');
  expect(text).toContain('http://lab:8080/login?code=…');
  expect(text).toContain('rheonaut login-link --data FOLDER');
  expect(text).not.toContain('no longer valid');
});

test('a link that is no longer valid is answered with what to do about it', () => {
  const text = drawn_at('/login');
  expect(text).toContain('This link is no longer valid');
  expect(text).toContain('rheonaut login-link --data FOLDER');
  expect(text).toContain('Or sign in');
});
