// Writes src/api_types.ts and src/telemetry_fields.ts from the station's OpenAPI document.
//
// A discriminator without a mapping names schemas, not the values of the property; the values stand in the schemas as
// `const`, which is all that TypeScript needs, so such discriminators are left out here.
import { readFileSync, writeFileSync } from 'node:fs';
import openapi_typescript, { astToString } from 'openapi-typescript';

const here = new URL('.', import.meta.url);
const document = readFileSync(new URL('../server/api/openapi.yaml', here), 'utf8');
const plain = document.replace(/^\s*discriminator: \{ propertyName: \w+ \}\n/gm, '');
const types = astToString(await openapi_typescript(plain, { defaultNonNullable: false }));
const target = new URL('src/api_types.ts', here);
writeFileSync(target, `// Generated from server/api/openapi.yaml by generate_types.mjs; not edited by hand.\n${types}`);

// The fields of a live batch: columns with a value per sample, and numbers that its samples share.
const batch = document.match(/^ {4}LiveSamples:\n(?: {5,}.*\n)+/m)[0];
const names = (type) =>
  [...batch.matchAll(new RegExp(`^ {8}(\\w+): \\{ ${type} \\}$`, 'gm'))].map(([, name]) => `  '${name}',\n`).join('');
const fields = `// Generated from server/api/openapi.yaml by generate_types.mjs; not edited by hand.

// What a live batch has for each of its samples.
export const kSampleFields = [
${names("\\$ref: '#/components/schemas/LiveColumn'")}] as const;

// The numbers that it has once for all of them.
export const kBatchNumbers = [
${names("type: \\[number, 'null'\\]")}] as const;
`;
writeFileSync(new URL('src/telemetry_fields.ts', here), fields);
