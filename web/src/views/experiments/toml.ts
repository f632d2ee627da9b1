// Reads the part of TOML in which profiles are written, and remembers the line of each key. The station's reader decides;
// this one is for the preview while somebody types.
//
// Left out: dates, multi-line strings, other bases, and underscores of numbers.

export type Value = string | number | boolean | Value[] | Table;
export interface Table {
  [key: string]: Value;
}

export class TextError extends Error {
  constructor(
    readonly line: number, // from 1
    message: string,
  ) {
    super(message);
  }
}

export interface Document {
  table: Table;
  lines: Map<string, number>; // of "step[0].duty", and of "step[0]" itself
}

const kBareKey = /[A-Za-z0-9_-]/;
const kEscapes: Record<string, string> = { n: '\n', t: '\t', r: '\r', '"': '"', '\\': '\\', b: '\b', f: '\f' };

export function parse_toml(text: string): Document {
  return new Reader(text).read();
}

class Reader {
  private at = 0;
  private line = 1;
  private readonly root: Table = {};
  private readonly lines = new Map<string, number>();

  constructor(private readonly text: string) {}

  read(): Document {
    let table = this.root;
    let path = '';
    for (this.skip_lines(); this.at < this.text.length; this.skip_lines()) {
      if (this.next() === '[') [table, path] = this.header();
      else this.pair(table, path);
      this.end_of_line();
    }
    return { table: this.root, lines: this.lines };
  }

  private next(): string {
    return this.text[this.at] ?? '';
  }

  private refuse(why: string): never {
    throw new TextError(this.line, why);
  }

  private skip_spaces(): void {
    while (this.next() === ' ' || this.next() === '\t') this.at += 1;
    if (this.next() === '#') while (this.at < this.text.length && this.next() !== '\n') this.at += 1;
  }

  private skip_lines(): void {
    for (this.skip_spaces(); '\r\n'.includes(this.next()) && this.next() !== ''; this.skip_spaces()) {
      if (this.next() === '\n') this.line += 1;
      this.at += 1;
    }
  }

  private end_of_line(): void {
    this.skip_spaces();
    if (!['', '\n', '\r'].includes(this.next())) this.refuse(`“${this.rest()}” is one too many in this line`);
  }

  private rest(): string {
    return this.text.slice(this.at).split('\n')[0]!.trim().slice(0, 24);
  }

  private expect(wanted: string): void {
    this.skip_spaces();
    if (!this.text.startsWith(wanted, this.at)) this.refuse(`“${wanted}” is missing before “${this.rest()}”`);
    this.at += wanted.length;
  }

  // [table] or [[list of tables]]; what follows belongs to it.
  private header(): [Table, string] {
    const is_list = this.text.startsWith('[[', this.at);
    this.expect(is_list ? '[[' : '[');
    const keys = this.keys();
    this.expect(is_list ? ']]' : ']');
    const last = keys.pop()!;
    let [table, path] = this.table_of(this.root, '', keys);
    path = path === '' ? last : `${path}.${last}`;
    if (is_list) {
      const list = (table[last] ??= []);
      if (!Array.isArray(list)) this.refuse(`${path} is no list`);
      path = `${path}[${list.length}]`;
      list.push((table = {}));
    } else {
      if (table[last] !== undefined) this.refuse(`[${path}] is there twice`);
      table = table[last] = {};
    }
    this.lines.set(path, this.line);
    return [table, path];
  }

  private pair(into: Table, of: string): void {
    const keys = this.keys();
    const last = keys.pop()!;
    const [table, path] = this.table_of(into, of, keys);
    const name = path === '' ? last : `${path}.${last}`;
    if (table[last] !== undefined) this.refuse(`${name} is there twice`);
    this.lines.set(name, this.line);
    this.expect('=');
    this.skip_spaces();
    table[last] = this.value(name);
  }

  private table_of(from: Table, of: string, keys: string[]): [Table, string] {
    let [table, path] = [from, of];
    for (const key of keys) {
      path = path === '' ? key : `${path}.${key}`;
      const found: Value = (table[key] ??= {});
      if (typeof found !== 'object' || Array.isArray(found)) this.refuse(`${path} is no table`);
      table = found;
    }
    return [table, path];
  }

  private keys(): string[] {
    const keys: string[] = [];
    do {
      if (keys.length > 0) this.at += 1;
      this.skip_spaces();
      let key = '';
      if (this.next() === '"' || this.next() === "'") key = this.string();
      else while (this.at < this.text.length && kBareKey.test(this.next())) key += this.text[this.at++];
      if (key === '') this.refuse(`a key is missing before “${this.rest()}”`);
      keys.push(key);
      this.skip_spaces();
    } while (this.next() === '.');
    return keys;
  }

  private value(name: string): Value {
    const first = this.next();
    if (first === '"' || first === "'") return this.string();
    if (first === '[') return this.list(name);
    if (first === '{') return this.inline_table(name);
    const word = /^[^\s,\]}#]*/.exec(this.text.slice(this.at))![0];
    this.at += word.length;
    if (word === 'true' || word === 'false') return word === 'true';
    if (/^[+-]?(0|[1-9]\d*)(\.\d+)?([eE][+-]?\d+)?$/.test(word)) return Number(word);
    if (word === '') this.refuse(`the value of ${name} is missing`);
    return this.refuse(`${word} is no number, text in quotes, true or false`);
  }

  private string(): string {
    const quote = this.text[this.at++]!;
    let text = '';
    for (; ; this.at += 1) {
      const letter = this.next();
      if (letter === '' || letter === '\n') this.refuse('the quote at the end of the text is missing');
      if (letter === quote) break;
      if (letter !== '\\' || quote === "'") {
        text += letter;
        continue;
      }
      this.at += 1;
      text += kEscapes[this.next()] ?? this.refuse(`\\${this.next()} means nothing in a text`);
    }
    this.at += 1;
    return text;
  }

  private list(name: string): Value[] {
    const list: Value[] = [];
    this.at += 1;
    for (this.skip_lines(); this.next() !== ']'; this.skip_lines()) {
      if (this.at >= this.text.length) this.refuse(`the ] at the end of ${name} is missing`);
      list.push(this.value(`${name}[${list.length}]`));
      this.skip_lines();
      if (this.next() === ',') this.at += 1;
      else if (this.next() !== ']') this.refuse(`“,” or “]” is missing before “${this.rest()}”`);
    }
    this.at += 1;
    return list;
  }

  private inline_table(name: string): Table {
    const table: Table = {};
    this.at += 1;
    for (this.skip_spaces(); this.next() !== '}'; this.skip_spaces()) {
      this.pair(table, name);
      this.skip_spaces();
      if (this.next() === ',') this.at += 1;
      else if (this.next() !== '}') this.refuse(`“,” or “}” is missing before “${this.rest()}”`);
    }
    this.at += 1;
    return table;
  }
}
