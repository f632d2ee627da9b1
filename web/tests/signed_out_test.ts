// What the page says to a browser that is not signed in: without a link, and with one that is no longer valid.
import { h, render } from 'preact';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Session } from '../src/session';
import { SignedOut } from '../src/views/signed_out';
import { fake_document, FakeNode } from './fake_dom';

const replaced: string[] = [];

beforeEach(() => vi.stubGlobal('document', fake_document));
afterEach(() => vi.unstubAllGlobals());

function drawn_at(pathname: string, search = '', session = {} as Session): FakeNode {
  vi.stubGlobal('location', {
    origin: 'http://lab:8080',
    pathname,
    search,
    replace: (to: string) => replaced.push(to),
  });
  const page = new FakeNode(1, 'body');
  render(h(SignedOut, { session }), page as unknown as Element);
  return page;
}

test('without a link it says where the station has printed one, and how another is made', () => {
  const { text } = drawn_at('/');
  expect(text).toContain('Open the link that the station printed');
  expect(text).toContain('http://lab:8080/login?code=…');
  expect(text).toContain('rheonaut login-link --data FOLDER');
  expect(text).not.toContain('Sign in with this link');
});

test('a link is redeemed when its button is pressed, and not before', async () => {
  const redeemed: string[] = [];
  const redeem_link = async (code: string) => void redeemed.push(code);
  const page = drawn_at('/login', '?code=a1', { api: { redeem_link } } as unknown as Session);
  expect(page.text).toContain('Or sign in');
  expect(redeemed).toEqual([]);
  page.find('use-link')!.fire('Click');
  await vi.waitFor(() => expect(replaced).toEqual(['/']));
  expect(redeemed).toEqual(['a1']);
});

test('a link that is no longer valid is answered with why', async () => {
  const redeem_link = () => Promise.reject(new Error('This link is no longer valid'));
  const page = drawn_at('/login', '?code=a1', { api: { redeem_link } } as unknown as Session);
  page.find('use-link')!.fire('Click');
  await vi.waitFor(() => expect(page.text).toContain('This link is no longer valid'));
});
