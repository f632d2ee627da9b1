// What is in force on the robot: its controller, its model and its parameters, as the robot has reported them last.

import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import type { ControllerInForce, ParametersInForce, RobotState } from '../api';
import { date_and_time, fluid_text } from '../format';
import type { Robot } from '../robot';
import type { Session } from '../session';

type Parameters = NonNullable<ParametersInForce['parameters']>;
const kAgain_ms = 1000; // a robot that has just connected reports both a moment later

export function InForce({ session, robot }: { session: Session; robot: Robot }) {
  const said = useSignal<{ parameters: ParametersInForce; controller: ControllerInForce } | null>(null);
  const problem = useSignal('');
  const tries = useSignal(0);
  const { robot_id, controller_checksum, parameters_checksum, link, boot_id, fluid, model } = robot.state.value;
  const phase = session.phase.value;
  // Read again whenever the robot reports other ones.
  useEffect(() => {
    if (phase !== 'live') return;
    let is_over = false;
    let timer: ReturnType<typeof setTimeout> | undefined;
    problem.value = '';
    const ask = () =>
      Promise.all([session.api.robot_parameters(robot_id), session.api.robot_controller(robot_id)]).then(
        ([parameters, controller]) => {
          if (is_over) return;
          said.value = { parameters, controller };
          const is_awaited = link === 'connected' && !(parameters.is_current && controller.is_current);
          if (is_awaited) timer = setTimeout(() => void ask(), kAgain_ms);
        },
        (error: Error) => is_over || (problem.value = error.message),
      );
    void ask();
    return () => {
      is_over = true;
      clearTimeout(timer);
    };
  }, [phase, controller_checksum, parameters_checksum, link, boot_id, tries.value]);
  if (problem.value) {
    return (
      <p class="failed" role="alert">
        {problem.value}{' '}
        <button type="button" onClick={() => (tries.value += 1)}>
          Try again
        </button>
      </p>
    );
  }
  if (said.value === null) return <p class="quiet">Reading what is in force …</p>;
  const { parameters, controller } = said.value;
  const is_heard = session.store.is_current.value;
  return (
    <div class="robot-in-force" tabIndex={0} role="region" aria-label={`In force on ${robot_id}`}>
      <dl>
        <dt>Controller</dt>
        <dd id="in-force-controller">
          {controller_text(controller)}
          {controller.controller && known_text(link, controller, is_heard)}
        </dd>
        <dt>Model</dt>
        <dd>
          {fluid === null ? 'fluid not known' : fluid_text(fluid)} · {model.state}
          {model.fit_error !== null && `, fit error ${(100 * model.fit_error).toFixed(2)} %`}
        </dd>
        <dt>Reported</dt>
        <dd>
          {parameters.told_at_us === null
            ? 'not since the station started'
            : date_and_time(parameters.told_at_us / 1000)}
          {parameters.told_at_us !== null && known_text(link, parameters, is_heard)}
        </dd>
      </dl>
      {parameters.parameters === null ? (
        <p class="quiet">The robot has not reported its parameters since the station started.</p>
      ) : (
        <ParameterTable parameters={parameters.parameters} />
      )}
    </div>
  );
}

function ParameterTable({ parameters }: { parameters: Parameters }) {
  return (
    <table>
      <thead>
        <tr>
          <th scope="col">Parameter</th>
          <th scope="col" class="number">
            Value
          </th>
          <th scope="col" class="number">
            Default
          </th>
          <th scope="col" class="number">
            Allowed
          </th>
          <th scope="col">Unit</th>
          <th scope="col">Note</th>
        </tr>
      </thead>
      <tbody>
        {parameters.map(({ name, unit, value, minimum, maximum, changed, bounds_motion, ...parameter }) => (
          <tr key={name} class={changed ? 'changed' : ''}>
            <td>{name}</td>
            <td class="number">{plain(value)}</td>
            <td class="number">{plain(parameter.default)}</td>
            <td class="number">{`${plain(minimum)} … ${plain(maximum)}`}</td>
            <td>{unit}</td>
            <td>{[changed && 'changed', bounds_motion && 'bounds motion'].filter(Boolean).join(' · ')}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

const plain = (value: number | null) =>
  value === null ? '–' : String(Number(value.toPrecision(7))).replace('-', '\u2212');

// SAFETY: what may be otherwise by now is not shown as what holds.
export function known_text(
  link: RobotState['link'],
  { is_current }: { is_current: boolean },
  is_heard: boolean,
): string {
  if (!is_heard) return ' · known last';
  if (link !== 'connected') return ' · known last: the robot is away';
  return is_current ? '' : ' · known last: the robot has not reported it again yet';
}

export function controller_text({ controller }: ControllerInForce): string {
  if (controller === null) return 'not reported since the station started';
  const sections = [
    controller.pole && controller.pole.length > 0 && `${controller.pole.length} first-order sections`,
    controller.biquad_b0 && controller.biquad_b0.length > 0 && `${controller.biquad_b0.length} second-order sections`,
  ].filter(Boolean);
  const limits = `duty ${plain(controller.duty_min ?? null)} to ${plain(controller.duty_max ?? null)}`;
  const name = controller.controller_id === undefined ? '' : `number ${controller.controller_id} · `;
  const of = sections.length > 0 ? `, ${sections.join(', ')}` : '';
  const period = `every ${controller.period_us / 1000} ms`;
  return `${name}kp ${plain(controller.kp)}${of} · ${period} · ${limits}`;
}
