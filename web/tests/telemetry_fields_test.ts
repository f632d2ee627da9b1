// The fields of the ring of samples are those of the station's document.
import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import { SampleRing } from '../src/samples';
import { kBatchNumbers, kSampleFields } from '../src/telemetry_fields';
import { batch } from './fakes';

const document = readFileSync(new URL('../../server/api/openapi.yaml', import.meta.url), 'utf8');
const live = document.slice(document.indexOf('\n    LiveSamples:'), document.indexOf('\n    LiveColumn:'));

function described(type: string): string[] {
  const lines = live.split('\n').filter((line) => line.endsWith(`: { ${type} }`));
  return lines.map((line) => line.trim().split(':')[0] as string);
}

test('the generated fields are those that the document has now', () => {
  expect([...kSampleFields]).toEqual(described("$ref: '#/components/schemas/LiveColumn'"));
  expect([...kBatchNumbers]).toEqual(described("type: [number, 'null']"));
});

test('the ring keeps every field of a batch', () => {
  const ring = new SampleRing(8);
  const sent = batch(0, 2);
  kSampleFields.forEach((name, column) => (sent[name] = [column + 1, column + 1.5]));
  kBatchNumbers.forEach((name, number) => (sent[name] = 100 + number));
  ring.append(sent, 1);
  kSampleFields.forEach((name, column) => expect(ring.columns[name][1]).toBe(column + 1.5));
  kBatchNumbers.forEach((name, number) => expect(ring.columns[name][1]).toBe(100 + number));
});
