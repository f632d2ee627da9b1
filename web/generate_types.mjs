// Writes src/api_types.ts from the station's OpenAPI document.
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
