// What the film and the pictures of the page have in common.
import { execFileSync } from 'node:child_process';
import { join } from 'node:path';
import { bin, until } from '../tests/browser/programs.mjs';

// The robot gets the model of its fluid and confirms it: its position is then as certain as the sensor allows.
export async function confirm_model(bench, robot_id, fluid) {
  const model = JSON.parse(execFileSync(join(bin, 'rheonaut'), ['estimator', '--plant', fluid, '--json']));
  await bench.post(`/fluids/${fluid}/model`, model);
  await bench.post(`/robots/${robot_id}/fluid`, { fluid });
  await until('the robot confirms its model', async () => (await bench.ask(`/robots/${robot_id}`)).model.state === 'confirmed');
}
