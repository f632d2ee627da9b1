// What the page says of the model behind a position's "±".
import { expect, test } from 'vitest';
import { model_of } from '../src/robot';

test('an estimate says whether its model is assumed, confirmed or does not fit; a known position has none', () => {
  expect(model_of(0, 0.004)).toBe('model assumed');
  expect(model_of(64, 0.004)).toBe('model confirmed');
  expect(model_of(64 | 128, 0.004)).toBe('model does not fit');
  expect(model_of(2 | 128, null)).toBe('model does not fit');
  expect(model_of(0, 0)).toBe('');
});
