// A file that another program writes is read when it is complete, and not before.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { read_json, until } from './programs.mjs';

const folder = mkdtempSync(join(tmpdir(), 'rheonaut-programs-'));
const file = join(folder, 'endpoints.json');
try {
  assert.equal(read_json(file), null, 'it is not there yet');
  for (const part of ['', '{', '{"pid": 1, "ht']) {
    writeFileSync(file, part);
    assert.equal(read_json(file), null, `only ${part} is written`);
  }
  let looks = 0;
  const said = await until('it is complete', () => {
    if (++looks === 3) writeFileSync(file, '{"pid": 1}');
    return read_json(file);
  });
  assert.deepEqual(said, { pid: 1 });
  assert.equal(looks, 3);
  writeFileSync(file, '{"pid": ');
  await assert.rejects(until('it is complete', () => read_json(file), 100), /not within 100 ms: it is complete/);
  assert.throws(() => read_json(folder), { code: 'EISDIR' });
} finally {
  rmSync(folder, { recursive: true });
}
