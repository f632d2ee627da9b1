// The text of a profile with the numbers of its lines. A line that is wrong is marked, and its error stands below.

import { useRef } from 'preact/hooks';

export interface TextFault {
  line: number | null; // null: of the text as a whole
  text: string;
  by: 'station' | 'page'; // the page judges while somebody types; the station when it is to begin
}

interface EditorProps {
  text: string;
  fault: TextFault | null;
  on_text(text: string): void;
}

export const kMostLetters = 32_000; // that the station takes

export function Editor({ text, fault, on_text }: EditorProps) {
  const field = useRef<HTMLTextAreaElement>(null);
  const lines = text.split('\n');
  const longest = lines.reduce((most, line) => Math.max(most, line.length), 0);
  const go_to = (line: number) => {
    const begin = lines.slice(0, line - 1).reduce((sum, each) => sum + each.length + 1, 0);
    field.current?.focus();
    field.current?.setSelectionRange(begin, begin + (lines[line - 1]?.length ?? 0));
  };
  return (
    <>
      <div class={`editor ${fault ? 'faulty' : ''}`}>
        <ol aria-hidden="true">
          {lines.map((_, index) => (
            <li key={index} class={fault?.line === index + 1 ? 'wrong' : ''}>
              <span>{index + 1}</span>
            </li>
          ))}
        </ol>
        <textarea
          id="profile-text"
          aria-label="Text of the profile"
          aria-invalid={fault !== null}
          aria-describedby="profile-fault"
          ref={field}
          rows={lines.length}
          cols={Math.max(30, longest + 1)}
          maxLength={kMostLetters}
          wrap="off"
          spellcheck={false}
          autoComplete="off"
          autoCapitalize="none"
          value={text}
          onInput={(event) => on_text(event.currentTarget.value)}
        />
      </div>
      <div class="fault" id="profile-fault" role="alert" data-line={fault?.line ?? ''}>
        {fault && (
          <>
            <p>
              {fault.line !== null && <b>Line {fault.line}: </b>}
              {fault.text}
              {fault.by === 'page' && <span class="quiet"> (as this page reads it; the station decides)</span>}
            </p>
            {fault.line !== null && (
              <button type="button" id="go-to-fault" onClick={() => go_to(fault.line!)}>
                Go to line {fault.line}
              </button>
            )}
          </>
        )}
      </div>
    </>
  );
}
