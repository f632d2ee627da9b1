// How the cockpit is built and tested. The station is proxied in development: RHEONAUT_STATION=http://127.0.0.1:8080.
import { readFileSync } from 'node:fs';
import { defineConfig } from 'vitest/config';

const station = process.env['RHEONAUT_STATION'] ?? 'http://127.0.0.1:8080';
const proxied = { target: station, changeOrigin: true };

// What is bundled comes under its authors' terms, which travel with it.
const third_parties = ['preact', '@preact/signals', '@preact/signals-core', 'uplot', 'uqr', '@fontsource/b612'];
const licences = () =>
  third_parties
    .map((name) => `${name}\n\n${readFileSync(`node_modules/${name}/LICENSE`, 'utf8').trim()}\n`)
    .join(`\n${'-'.repeat(80)}\n\n`);

export default defineConfig({
  esbuild: { jsx: 'automatic', jsxImportSource: 'preact' },
  plugins: [
    {
      name: 'licences',
      generateBundle() {
        this.emitFile({ type: 'asset', fileName: 'licences.txt', source: licences() });
      },
    },
  ],
  build: {
    target: 'es2022',
    // The station's content security policy takes files of its own origin and nothing inline.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
  },
  server: { proxy: { '/api': proxied, '/live': { ...proxied, ws: true } } },
  test: { include: ['tests/**/*_test.ts'], environment: 'node' },
});
