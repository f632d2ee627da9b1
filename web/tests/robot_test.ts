// What the page says of the model behind a position's "±", and of limits that were changed.
import { expect, test } from 'vitest';
import { changed_limits_of, model_of } from '../src/robot';

test('an estimate says whether its model is assumed, confirmed or does not fit; a known position has none', () => {
  expect(model_of(0, 0.004)).toBe('model assumed');
  expect(model_of(64, 0.004)).toBe('model confirmed');
  expect(model_of(64 | 128, 0.004)).toBe('model does not fit');
  expect(model_of(2 | 128, null)).toBe('model does not fit');
  expect(model_of(0, 0)).toBe('');
});

test('limits that are not at their default stand in one line, and nothing where there are none', () => {
  expect(changed_limits_of({ changed_limits: [] })).toBe('');
  const far = { name: 'position_limit_max_m', unit: 'm', value: 0.2, default: 100 };
  expect(changed_limits_of({ changed_limits: [far] })).toBe('Changed limits: position_limit_max_m 0.2 m (default 100 m)');
  const action = { name: 'link_loss_action', unit: '', value: 2, default: 0 };
  expect(changed_limits_of({ changed_limits: [far, action] })).toBe(
    'Changed limits: position_limit_max_m 0.2 m (default 100 m), link_loss_action 2 (default 0)',
  );
});
