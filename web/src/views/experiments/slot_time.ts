// Date and time of a slot as a person types them: the page opens no calendar of the browser.

const kDay_ms = 86_400_000;

// "2026-11-26", "26.11.", "26.11.2026", "today", "tomorrow"; the local day. null: it is none.
export function parse_day(text: string, now_ms: number): Date | null {
  const plain = text.trim().toLowerCase();
  const now = new Date(now_ms);
  const day_of = (year: number, month: number, day: number) => {
    const date = new Date(year, month - 1, day);
    return date.getMonth() === month - 1 && date.getDate() === day ? date : null;
  };
  if (plain === '' || plain === 'today') return day_of(now.getFullYear(), now.getMonth() + 1, now.getDate());
  if (plain === 'tomorrow') return new Date(now.getFullYear(), now.getMonth(), now.getDate() + 1);
  const iso = /^(\d{4})-(\d{1,2})-(\d{1,2})$/.exec(plain);
  if (iso) return day_of(Number(iso[1]), Number(iso[2]), Number(iso[3]));
  const dotted = /^(\d{1,2})\.(\d{1,2})\.(\d{4})?$/.exec(plain);
  if (!dotted) return null;
  const found = day_of(Number(dotted[3] ?? now.getFullYear()), Number(dotted[2]), Number(dotted[1]));
  // Without a year: the next one of this name.
  if (found && dotted[3] === undefined && found.getTime() < now_ms - kDay_ms) found.setFullYear(now.getFullYear() + 1);
  return found;
}

// "14:30", "14.30", "14", "9:05"; minutes of the day. null: it is none.
export function parse_clock(text: string): number | null {
  const found = /^(\d{1,2})(?:[:.](\d{2}))?$/.exec(text.trim());
  const [hours, minutes] = [Number(found?.[1] ?? NaN), Number(found?.[2] ?? 0)];
  const is_time = (hours < 24 && minutes < 60) || (hours === 24 && minutes === 0);
  return is_time ? hours * 60 + minutes : null;
}

export interface SlotText {
  from_day: string;
  from_clock: string; // '': now
  until_day: string; // '': the day of the beginning
  until_clock: string;
}

export interface Slot {
  from_ms: number | null; // null: now
  until_ms: number;
}

const kLongest_ms = 7 * kDay_ms;

// A sentence says which field is wrong and what to type.
export function parse_slot(text: SlotText, now_ms: number): Slot | { problem: string } {
  const problem = (what: string) => ({ problem: what });
  const kDays = 'Type a day like 2026-11-26, 26.11. or tomorrow.';
  const kClocks = 'Type a time like 14:30.';
  const at = (day: Date, minutes: number) =>
    new Date(day.getFullYear(), day.getMonth(), day.getDate(), 0, minutes).getTime();

  const from_day = parse_day(text.from_day, now_ms);
  if (!from_day) return problem(`From: “${text.from_day}” is no day. ${kDays}`);
  const is_now = text.from_clock.trim() === '' || text.from_clock.trim().toLowerCase() === 'now';
  const from_clock = is_now ? null : parse_clock(text.from_clock);
  if (!is_now && from_clock === null) return problem(`From: “${text.from_clock}” is no time. ${kClocks}`);
  const today = parse_day('today', now_ms)!;
  if (is_now && from_day.getTime() !== today.getTime()) return problem(`From: the time is missing. ${kClocks}`);
  const from_ms = from_clock === null ? null : at(from_day, from_clock);

  const until_day = text.until_day.trim() === '' ? from_day : parse_day(text.until_day, now_ms);
  if (!until_day) return problem(`Until: “${text.until_day}” is no day. ${kDays}`);
  const until_clock = parse_clock(text.until_clock);
  if (until_clock === null) {
    const what = text.until_clock.trim() === '' ? 'the time is missing' : `“${text.until_clock}” is no time`;
    return problem(`Until: ${what}. ${kClocks}`);
  }
  const until_ms = at(until_day, until_clock);
  if (from_ms !== null && from_ms < now_ms - 60_000)
    return problem('From: that is in the past. Leave the time empty for now.');
  if (until_ms <= (from_ms ?? now_ms)) return problem('Until: that is not after the beginning.');
  if (until_ms - (from_ms ?? now_ms) > kLongest_ms) return problem('A slot lasts at most 7 days.');
  return { from_ms, until_ms };
}

// "2026-11-26", as the fields show it.
export function day_text(at_ms: number): string {
  const date = new Date(at_ms);
  const two = (value: number) => String(value).padStart(2, '0');
  return `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
}

// "Thu 26 Nov 14:30", of a slot.
export function moment_text(at_us: number): string {
  const date = new Date(at_us / 1000);
  const two = (value: number) => String(value).padStart(2, '0');
  const day = date.toLocaleDateString('en-GB', { weekday: 'short', day: 'numeric', month: 'short' });
  return `${day.replace(',', '')} ${two(date.getHours())}:${two(date.getMinutes())}`;
}
