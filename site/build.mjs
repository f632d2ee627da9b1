// Makes a site of the documents: node site/build.mjs OUT [BASE]. deploy/site installs what it needs and calls it.
//   OUT    the folder of the site, made anew; any web server can serve it
//   BASE   where on the server it will stand, such as /rheonaut/; / if not given
// The documents are copied into site/pages with their places kept, so that their links to each other hold; a README is
// the first page of its folder. A file that a document links to and that is none (LICENSE) is copied as well, as text.
import { copyFileSync, cpSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { dirname, join, posix, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const root = dirname(here);
const pages = join(here, 'pages');

const documents = [
  ...readdirSync(root).filter((name) => name.endsWith('.md')),
  ...readdirSync(join(root, 'docs'), { recursive: true }).filter((name) => name.endsWith('.md')).map((name) => `docs/${name}`),
];

const name_of_page = (name) => name.replace(/(^|\/)README\.md(?=#|$)/, '$1index.md');

// The document with its links turned to pages, and those to files that are no documents to copies of them.
function with_links(name, text) {
  return text.replace(/(?<=\]\()[^)\s]+(?=\))/g, name_of_page).replace(/\]\(([^)\s#]+)\)/g, (link, target) => {
    if (/^\w+:/.test(target) || /\.(md|webp|png|svg)$/.test(target)) return link;
    const file = posix.join(posix.dirname(name), target);
    const copy = posix.join('files', `${file}.txt`);
    mkdirSync(join(pages, 'public', dirname(copy)), { recursive: true });
    copyFileSync(join(root, file), join(pages, 'public', copy));
    return `](/${copy})`;
  });
}

function gather() {
  rmSync(pages, { recursive: true, force: true });
  for (const name of documents) {
    mkdirSync(join(pages, dirname(name)), { recursive: true });
    writeFileSync(join(pages, name_of_page(name)), with_links(name, readFileSync(join(root, name), 'utf8')));
  }
  cpSync(join(root, 'docs'), join(pages, 'docs'), { recursive: true, filter: (from) => !from.endsWith('.md') });
}

const [out, base = '/'] = process.argv.slice(2);
if (!out || !/^\/(.*\/)?$/.test(base)) {
  console.error('usage: deploy/site OUT [BASE], where BASE begins and ends with /');
  process.exit(2);
}
gather();
process.env.SITE_BASE = base;
const { build } = await import('vitepress');
await build(here, { outDir: resolve(out), emptyOutDir: true });
rmSync(pages, { recursive: true, force: true });
console.log(`site: ${resolve(out)}; to look at it: python3 -m http.server 8000 --bind 127.0.0.1 --directory ${resolve(out)}`);
