// A QR code, drawn in the page: always dark on white, with the quiet zone that cameras need, whatever the theme.

import { useMemo } from 'preact/hooks';
import { encode } from 'uqr';
import { module_path } from './enrolment';

const kQuiet = 4; // modules around it

export function QrCode({ id, text, label }: { id: string; text: string; label: string }) {
  const { path, size } = useMemo(() => {
    const { data } = encode(text, { ecc: 'M', border: 0 });
    return { path: module_path(data), size: data.length };
  }, [text]);
  return (
    <svg
      class="station-qr"
      id={id}
      role="img"
      aria-label={label}
      viewBox={`${-kQuiet} ${-kQuiet} ${size + 2 * kQuiet} ${size + 2 * kQuiet}`}
      shape-rendering="crispEdges"
    >
      <rect x={-kQuiet} y={-kQuiet} width={size + 2 * kQuiet} height={size + 2 * kQuiet} />
      <path d={path} />
    </svg>
  );
}
