// What ESLint holds the page to, with types known: promises are awaited, names are as in the other languages.
import tseslint from 'typescript-eslint';

const names = [
  { selector: 'default', format: ['snake_case'], leadingUnderscore: 'allow' },
  {
    selector: 'variable', // kLongest_ms for constants, PascalCase for components
    format: null,
    custom: { regex: '^(k[A-Z]\\w*|_?[a-z][a-z0-9_]*|_|[A-Z]\\w*)$', match: true },
  },
  {
    selector: 'function', // PascalCase for components, useWhat for hooks
    format: null,
    custom: { regex: '^(use[A-Z]\\w*|[a-z][a-z0-9_]*|[A-Z]\\w*)$', match: true },
  },
  { selector: 'import', format: null },
  { selector: 'typeLike', format: ['PascalCase'] },
  { selector: ['objectLiteralProperty', 'objectLiteralMethod', 'typeProperty', 'typeMethod'], format: null }, // others' APIs
];

export default tseslint.config(
  { ignores: ['dist', 'node_modules', 'src/api_types.ts'] },
  {
    files: ['src/**/*.{ts,tsx}', 'tests/**/*.ts', 'dev/**/*.tsx', 'vite.config.ts'],
    extends: [tseslint.configs.recommendedTypeChecked],
    languageOptions: { parserOptions: { project: './tsconfig.json', tsconfigRootDir: import.meta.dirname } },
    rules: {
      '@typescript-eslint/naming-convention': ['error', ...names],
      '@typescript-eslint/unbound-method': 'off', // the types of Preact and uPlot do not say which methods use `this`
      eqeqeq: 'error',
    },
  },
  {
    files: ['tests/**/*.ts'], // fakes have the names of what they stand for
    rules: {
      '@typescript-eslint/naming-convention': 'off',
      '@typescript-eslint/no-base-to-string': 'off',
      '@typescript-eslint/require-await': 'off',
    },
  },
);
