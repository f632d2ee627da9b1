// A design as an address, and the steps that "back" undoes.
import { beforeEach, expect, test } from 'vitest';
import { parse } from '../../src/route';
import type { StoredDesign } from '../../src/views/design/design_api';
import { kPaperPlants } from '../../src/views/design/frequency';
import {
  address_of,
  kNothing,
  parse_design,
  Steps,
  with_controller,
  with_plant,
  with_run,
  type Design,
} from '../../src/views/design/address';

const full: Design = {
  runs: [3, 4],
  structure: 'fractional',
  from_s: 1.5,
  to_s: 60,
  validation: 5,
  limit_s: 120,
  fit: 7,
  model: 6,
  fluid: '',
  paper: '',
  crossover_rad_s: 2.5,
  margin_deg: 95,
  controller: 8,
  robot: 'sim-1',
  verified: 9,
};
const read = (address: string) => parse_design(parse(address).query);

test('an address says all of a design, and leads back to it', () => {
  expect(address_of(full)).toBe(
    '#/design?runs=3%2C4&structure=fractional&from=1.5&to=60&validation=5&limit=120&fit=7&model=6&crossover=2.5&margin=95&controller=8&robot=sim-1&verified=9',
  );
  expect(read(address_of(full))).toEqual(full);
  expect(read('#/design?runs=3,4')).toEqual({ ...kNothing, runs: [3, 4] });
});

test('what is as usual is left out', () => {
  expect(address_of(kNothing)).toBe('#/design');
  expect(read('#/design')).toEqual(kNothing);
});

test('what is wrong in an address is passed over', () => {
  const design = read('#/design?runs=3,x,3,-1&structure=best&from=-2&to=0&crossover=1e9&margin=abc&paper=30&model=1.5');
  expect(design).toEqual({ ...kNothing, runs: [3] });
  expect(read('#/design?from=10&to=5').to_s).toBeNull();
  expect(read(`#/design?runs=${Array.from({ length: 20 }, (_, at) => at + 1).join(',')}`).runs).toHaveLength(8);
});

test('another plant takes the controller out, and other runs the fit', () => {
  expect(with_plant(full, { fluid: 'water' })).toMatchObject({
    model: null,
    fluid: 'water',
    controller: null,
    verified: null,
  });
  expect(with_run(full, 5, true)).toMatchObject({ runs: [3, 4, 5], fit: null, model: 6 });
  expect(with_run(full, 3, false).runs).toEqual([4]);
});

// What a browser does: its entries, and where it is.
class FakeBrowser {
  entries = ['#/fleet'];
  at = 0;
  steps: Steps | null = null;
  go(address: string) {
    this.entries = [...this.entries.slice(0, this.at + 1), address];
    this.at += 1;
    this.steps?.follow(address);
  }
  back() {
    this.at -= 1;
    this.steps?.follow(this.entries[this.at]!);
  }
  forward() {
    this.at += 1;
    this.steps?.follow(this.entries[this.at]!);
  }
}

let browser: FakeBrowser;
let steps: Steps;
beforeEach(() => {
  browser = new FakeBrowser();
  steps = new Steps(browser);
  browser.go('#/design');
  browser.steps = steps;
  steps.open('#/design');
});

test('choices are undone and done again, one by one', () => {
  expect([steps.can_undo.value, steps.can_redo.value]).toEqual([false, false]);
  browser.go('#/design?model=1');
  browser.go('#/design?model=1&margin=95');
  steps.undo();
  expect(steps.last).toBe('#/design?model=1');
  expect([steps.can_undo.value, steps.can_redo.value]).toEqual([true, true]);
  steps.redo();
  expect(browser.entries[browser.at]).toBe('#/design?model=1&margin=95');
  expect(steps.can_redo.value).toBe(false);
});

test('the browser’s own "back" is the same undo, and another choice ends what could be done again', () => {
  browser.go('#/design?model=1');
  browser.back();
  expect([steps.can_undo.value, steps.can_redo.value]).toEqual([false, true]);
  browser.go('#/design?model=2');
  expect([steps.can_undo.value, steps.can_redo.value]).toEqual([true, false]);
});

test('undo never leads out of the view: what lies before it was opened is not its own', () => {
  browser.go('#/design?model=1');
  browser.steps = null; // another view is shown
  browser.go('#/runs/3');
  browser.go('#/design?model=1');
  browser.steps = steps;
  steps.open('#/design?model=1');
  expect(steps.can_undo.value).toBe(false);
  steps.undo();
  expect(browser.entries[browser.at]).toBe('#/design?model=1');
});

test('what no person has chosen is no step', () => {
  browser.go('#/design?runs=3');
  steps.replace('#/design?runs=3&fit=7');
  browser.entries[browser.at] = '#/design?runs=3&fit=7';
  steps.follow('#/design?runs=3&fit=7');
  steps.undo();
  expect(steps.last).toBe('#/design');
  expect(steps.can_undo.value).toBe(false);
});

test('a controller that is kept brings the plant and the specification that it was tuned for, or no plant', () => {
  const design = { ...kNothing, model: 5, verified: 9 };
  const used = (options: object, model_id: number | null = null) =>
    with_controller(design, { design_id: 8, kind: 'controller', model_id, options } as StoredDesign);
  const asked = { crossover_rad_s: 2, phase_margin_deg: 80 };
  const as_asked = { ...kNothing, controller: 8, crossover_rad_s: 2, margin_deg: 80 };
  expect(used({ ...asked, model_id: 7 }, 7)).toEqual({ ...as_asked, model: 7 });
  expect(used({ ...asked, fluid: 'water' })).toEqual({ ...as_asked, fluid: 'water' });
  expect(used({ ...asked, plant: { ...kPaperPlants['28'] } })).toEqual({ ...as_asked, paper: '28' });
  const without_plant = { ...kNothing, controller: 8 };
  expect(used({ ...asked, plant: { ...kPaperPlants['28'], kp: 200 } })).toEqual(without_plant);
  expect(used({ fluid: 'water' })).toEqual(without_plant);
  expect(used({ ...asked, crossover_rad_s: 0.2 }, 7)).toEqual(without_plant); // no address can say it
});
