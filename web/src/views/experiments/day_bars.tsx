// The next days of each robot as a bar, with the slots that are reserved in it.

import type { Reservation } from '../../experiments_api';
import { moment_text } from './slot_time';
import { who } from './words';

const kDays = 7;
const kHour_ms = 3_600_000;
const kMostRobots = 12;
const kRow = 10; // height, in the unit of the drawing: an hour wide, stretched to the page

interface DayBarsProps {
  reservations: readonly Reservation[];
  robots: readonly string[];
  account: string; // of this page
  now_ms: number;
}

// Robots that are reserved first; of a large fleet only those.
export function rows_of(reservations: readonly Reservation[], robots: readonly string[]): string[] {
  const reserved = [...new Set(reservations.map((each) => each.robot_id))].sort();
  const others = robots.filter((robot_id) => !reserved.includes(robot_id));
  return [...reserved, ...(robots.length <= kMostRobots ? others : [])];
}

// Where a slot lies in the days shown, in hours; null: outside of them.
export function place_of(slot: Pick<Reservation, 'from_us' | 'until_us'>, begin_ms: number) {
  const from_h = Math.max(0, (slot.from_us / 1000 - begin_ms) / kHour_ms);
  const until_h = Math.min(kDays * 24, (slot.until_us / 1000 - begin_ms) / kHour_ms);
  return until_h > from_h ? { x: from_h, width: Math.max(until_h - from_h, 0.5) } : null;
}

export function DayBars({ reservations, robots, account, now_ms }: DayBarsProps) {
  const now = new Date(now_ms);
  const begin_ms = new Date(now.getFullYear(), now.getMonth(), now.getDate()).getTime();
  const days = Array.from({ length: kDays }, (_, index) => {
    const day = new Date(now.getFullYear(), now.getMonth(), now.getDate() + index);
    return day.toLocaleDateString('en-GB', { weekday: 'short', day: 'numeric' });
  });
  const rows = rows_of(reservations, robots);
  if (rows.length === 0) return <p class="quiet empty">No robot is reserved.</p>;
  return (
    <div class="day-bars" id="day-bars">
      <div class="day-names" aria-hidden="true">
        {days.map((day) => (
          <span key={day}>{day}</span>
        ))}
      </div>
      {rows.map((robot_id) => {
        const slots = reservations.filter((each) => each.robot_id === robot_id);
        const said = slots.map(
          (each) => `${moment_text(each.from_us)} to ${moment_text(each.until_us)} for ${who(each.holder)}`,
        );
        return (
          <div class="day-row" key={robot_id}>
            <span class="name">{robot_id}</span>
            <svg
              viewBox={`0 0 ${kDays * 24} ${kRow}`}
              preserveAspectRatio="none"
              role="img"
              aria-label={`${robot_id}: ${said.length === 0 ? 'not reserved' : said.join('; ')}`}
            >
              {days.map((_, index) => (
                <line key={index} class="day" x1={index * 24} x2={index * 24} y1={0} y2={kRow} />
              ))}
              {slots.map((each) => {
                const place = place_of(each, begin_ms);
                return (
                  place && (
                    <rect
                      key={each.reservation_id}
                      class={each.holder === account ? 'mine' : 'other'}
                      x={place.x}
                      width={place.width}
                      y={1.5}
                      height={kRow - 3}
                    >
                      <title>{`${who(each.holder)}: ${each.purpose}`}</title>
                    </rect>
                  )
                );
              })}
              <line
                class="now"
                x1={(now_ms - begin_ms) / kHour_ms}
                x2={(now_ms - begin_ms) / kHour_ms}
                y1={0}
                y2={kRow}
              />
            </svg>
          </div>
        );
      })}
    </div>
  );
}
