// The check list as it is shown: what the station would wait for, and what to do.

import type { Robot } from '../../robot';
import { format } from '../../route';
import type { Session } from '../../session';
import { fluid_text } from '../../format';
import { useActs } from './acts';
import type { Check } from './checks';
import type { Profile } from './profile';

const kMarks: Record<Check['state'], { sign: string; spoken: string }> = {
  ok: { sign: '✓', spoken: 'ready' },
  waits: { sign: '!', spoken: 'the station waits for this' },
  unknown: { sign: '–', spoken: 'not known' },
};
const kOnRobotPage: Check['key'][] = ['rest', 'control'];

interface CheckListProps {
  session: Session;
  robot: Robot | null;
  checks: Check[];
  profile: Profile | null;
}

export function CheckList({ session, robot, checks, profile }: CheckListProps) {
  const { pending, problem, act } = useActs();
  const is_current = session.store.is_current.value;
  if (!robot) return null;
  if (!is_current) return <p class="quiet">Cut off from the station: what holds now is not known.</p>;
  const needed = profile?.fluids[0] ?? profile?.fluid ?? '';
  return (
    <>
      <ul class="checks" id="checks">
        {checks.map(({ key, state, text, todo }) => (
          <li key={key} class={state} id={`check-${key}`}>
            <span class="mark" aria-hidden="true">
              {kMarks[state].sign}
            </span>
            <span>
              <span class="unseen">{kMarks[state].spoken}: </span>
              {text} {todo !== '' && <b>{todo}</b>}{' '}
              {state === 'waits' && kOnRobotPage.includes(key) && (
                <a href={format({ view: 'robot', parts: [robot.robot_id] })}>Open {robot.robot_id}</a>
              )}
            </span>
            {state === 'waits' && key === 'fluid' && (
              <button
                type="button"
                id="say-fluid"
                disabled={pending.value !== ''}
                onClick={() => void act('fluid', () => session.api.set_fluid(robot.robot_id, needed))}
              >
                It is in {fluid_text(needed)} now
              </button>
            )}
          </li>
        ))}
      </ul>
      {problem.value !== '' && (
        <p class="problem" role="alert">
          {problem.value}
        </p>
      )}
    </>
  );
}
