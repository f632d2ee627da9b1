// The site of the documents: what stands where in its menus, and how Markdown is read. Made by site/build.mjs.
import { readFileSync, readdirSync } from 'node:fs';
import { defineConfig } from 'vitepress';

// As GitHub makes the anchors of headings, so that one link is right in both places; tests/check_docs.py follows them.
const slugify = (heading) => heading.trim().toLowerCase().replace(/[^\p{L}\p{N}_\- ]/gu, '').replace(/ /g, '-');

const page = (text, name) => ({ text, link: `/docs/${name}` });

const sidebar = [
  {
    text: 'Begin',
    items: [
      { text: 'Rheonaut', link: '/' },
      page('All documents', ''),
      page('Concepts', 'concepts'),
      page('A first robot', 'first_robot'),
      page('A first working day', 'tutorial'),
      page('Questions and answers', 'faq'),
      page('Troubleshooting', 'troubleshooting'),
      page('Glossary', 'glossary'),
    ],
  },
  {
    text: 'Use',
    items: [
      page('The page', 'cockpit'),
      page('Command line', 'commands'),
      page('Experiments', 'experiments'),
      page('HTTP and live interface', 'api'),
      page('Operations', 'operations'),
      page('Hardware', 'hardware'),
      page('Many robots', 'fleet'),
      page('When one station is not enough', 'scale'),
      page('Your own robot', 'your_own_robot'),
      page('Simulated robot', 'simulator'),
      page('Scenarios', 'scenarios'),
      page('Network faults', 'network_faults'),
    ],
  },
  {
    text: 'Look up',
    items: [
      page('The robot', 'robot'),
      page('Protocol', 'protocol'),
      page('Database', 'database'),
      page('Mathematics', 'control'),
      page('Reliability', 'reliability'),
      page('Security', 'security'),
      page('Performance', 'performance'),
      page('What else you could use', 'comparison'),
      page('Compatibility', 'compatibility'),
      page('The paper, number by number', 'paper'),
      page('References', 'references'),
    ],
  },
  {
    text: 'Change',
    items: [
      { text: 'Architecture', link: '/ARCHITECTURE' },
      { text: 'Contributing', link: '/CONTRIBUTING' },
      page('Tests as stories', 'test_stories'),
      page('Decisions', 'decisions/'),
      { text: 'Changes', link: '/CHANGELOG' },
    ],
  },
];

// A document that no menu above names yet is in one of its own, by its first heading.
const listed = new Set(sidebar.flatMap(({ items }) => items.map(({ link }) => link)));
const pages = new URL('../pages/', import.meta.url);
const others = ['', 'docs/'].flatMap((folder) =>
  readdirSync(new URL(folder || '.', pages))
    .filter((name) => name.endsWith('.md') && name !== 'index.md' && !listed.has(`/${folder}${name.slice(0, -3)}`))
    .map((name) => ({ text: /^# (.+)$/m.exec(readFileSync(new URL(folder + name, pages), 'utf8'))?.[1] ?? name, link: `/${folder}${name.slice(0, -3)}` })),
);
if (others.length > 0) sidebar.push({ text: 'More', items: others });

export default defineConfig({
  title: 'Rheonaut',
  description: 'Ground station for a small robot that swims in a non-Newtonian fluid',
  lang: 'en',
  base: process.env.SITE_BASE ?? '/',
  srcDir: 'pages',
  cacheDir: 'node_modules/.vitepress',
  markdown: { anchor: { slugify }, languageAlias: { hex: 'ini' } },
  themeConfig: {
    search: { provider: 'local' },
    outline: { level: [2, 3] },
    sidebar,
    docFooter: { prev: false, next: false },
  },
});
