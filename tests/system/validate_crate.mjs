// Validates RO-Crate metadata as `rocval` of the package ro-crate does, without a network: node validate_crate.mjs FILE...
//
// The first file is ro-crate-metadata.json, the others are the names of the files beside it. The context of RO-Crate 1.1
// is read from web/tests/ro_crate_1_1_context.json: the terms that we use, as the specification publishes them (CC0). A
// line for each error and warning, and exit status 1, if there is one.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';

const require = createRequire(new URL('../../web/package.json', import.meta.url));
const kContext = new URL('../../web/tests/ro_crate_1_1_context.json', import.meta.url);
const context = JSON.parse(readFileSync(kContext, 'utf8'));
globalThis.fetch = async (url) => {
  if (url !== context['@id']) throw new Error(`${url} is asked for, and there is no network`);
  return { ok: true, json: async () => context };
};
const { Validator } = require('ro-crate/lib/validator');

const [metadata, ...files] = process.argv.slice(2);
const text = readFileSync(metadata, 'utf8');
const validator = new Validator();
validator.parseJSON(text);
if (!validator.crate) throw new Error(JSON.stringify(validator.results));
await validator.crate.resolveContext();
await validator.validate();
validator.checkFiles(Object.fromEntries(files.map((file) => [file, { exists: true, isDir: false }])));
const faults = validator.results.filter((result) => result.status !== 'success').map((result) => JSON.stringify(result));

// Beyond the validator: each term of each entity is one of the context.
for (const entity of JSON.parse(text)['@graph']) {
  for (const term of [entity['@type'], ...Object.keys(entity).filter((key) => !key.startsWith('@'))]) {
    if (!validator.crate.resolveTerm(term)) faults.push(`${entity['@id']}: the term ${term} is not in the context`);
  }
}
for (const fault of faults) console.log(fault);
process.exit(faults.length === 0 ? 0 : 1);
