// Copies a text; where the browser has no clipboard (plain HTTP from another machine) it selects the text instead.

export type Copied = 'copied' | 'selected' | 'failed';

interface Hands {
  clipboard: Pick<Clipboard, 'writeText'> | undefined;
  select(): void;
}

export async function copy_text(text: string, { clipboard, select }: Hands): Promise<Copied> {
  try {
    if (clipboard) {
      await clipboard.writeText(text);
      return 'copied';
    }
  } catch {
    // The browser has refused it: the text can still be selected.
  }
  try {
    select();
    return 'selected';
  } catch {
    return 'failed';
  }
}

export const kCopiedText: Record<Copied, string> = {
  copied: 'Copied',
  selected: 'Selected: press Ctrl C',
  failed: 'Mark it and copy it by hand',
};
