// As much of a document as a part of the page needs to be drawn and pressed without a browser.

type Listener = (this: FakeNode, event: object) => void;

export class FakeNode {
  readonly namespaceURI = 'http://www.w3.org/1999/xhtml';
  readonly ownerDocument = null;
  readonly style = {};
  readonly childNodes: FakeNode[] = [];
  readonly attributes: Record<string, string> = {};
  readonly listeners = new Map<string, Listener>();
  parentNode: FakeNode | null = null;
  tabIndex = 0;

  constructor(
    readonly nodeType: number,
    readonly localName: string,
    public data = '',
  ) {}

  get firstChild(): FakeNode | null {
    return this.childNodes[0] ?? null;
  }
  get nextSibling(): FakeNode | null {
    const siblings = this.parentNode?.childNodes ?? [];
    return siblings[siblings.indexOf(this) + 1] ?? null;
  }
  get text(): string {
    return this.data + this.childNodes.map((child) => child.text).join('');
  }

  insertBefore(node: FakeNode, before: FakeNode | null): FakeNode {
    node.remove();
    node.parentNode = this;
    this.childNodes.splice(before ? this.childNodes.indexOf(before) : this.childNodes.length, 0, node);
    return node;
  }
  appendChild(node: FakeNode): FakeNode {
    return this.insertBefore(node, null);
  }
  removeChild(node: FakeNode): void {
    if (node.contains(fake_document.activeElement)) fake_document.activeElement = null;
    this.childNodes.splice(this.childNodes.indexOf(node), 1);
    node.parentNode = null;
  }
  get parentElement(): FakeNode | null {
    return this.parentNode;
  }
  focus(): void {
    fake_document.activeElement = this;
  }
  matches(selector: ':disabled'): boolean {
    return selector === ':disabled' && 'disabled' in this.attributes;
  }
  remove(): void {
    this.parentNode?.removeChild(this);
  }
  contains(node: FakeNode | null): boolean {
    return node !== null && (node === this || this.contains(node.parentNode));
  }
  setAttribute(name: string, value: string): void {
    this.attributes[name] = String(value);
  }
  removeAttribute(name: string): void {
    delete this.attributes[name];
  }
  addEventListener(type: string, listener: Listener): void {
    this.listeners.set(type, listener);
  }
  removeEventListener(type: string): void {
    this.listeners.delete(type);
  }
  get children(): FakeNode[] {
    return this.childNodes.filter((child) => child.nodeType === 1);
  }
  setPointerCapture(): void {}
  scrollIntoView(): void {}

  find(id: string): FakeNode | null {
    if (this.attributes['id'] === id) return this;
    for (const child of this.childNodes) {
      const found = child.find(id);
      if (found) return found;
    }
    return null;
  }
  // `type` as in "PointerDown".
  fire(type: string, event: object = {}): void {
    this.listeners
      .get(type)
      ?.call(this, { type, currentTarget: this, button: 0, preventDefault: () => undefined, ...event });
  }
}

export const fake_document = {
  activeElement: null as FakeNode | null,
  createElementNS: (_: string, name: string) => new FakeNode(1, name),
  createElement: (name: string) => new FakeNode(1, name),
  createTextNode: (text: string) => new FakeNode(3, '', text),
};
