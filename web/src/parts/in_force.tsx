// What is in force on the robot: its controller, its model and its parameters, as the robot has reported them last.

import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import type { ControllerInForce, ParametersInForce } from '../api';
import { date_and_time, fluid_text } from '../format';
import type { Robot } from '../robot';
import type { Session } from '../session';

type Parameters = NonNullable<ParametersInForce['parameters']>;

export function InForce({ session, robot }: { session: Session; robot: Robot }) {
  const said = useSignal<{ parameters: ParametersInForce; controller: ControllerInForce } | null>(null);
  const problem = useSignal('');
  const { robot_id, controller_checksum, parameters_checksum, link, boot_id, fluid, model } = robot.state.value;
  const load = () => {
    let is_over = false;
    problem.value = '';
    Promise.all([session.api.robot_parameters(robot_id), session.api.robot_controller(robot_id)]).then(
      ([parameters, controller]) => is_over || (said.value = { parameters, controller }),
      (error: Error) => is_over || (problem.value = error.message),
    );
    return () => void (is_over = true);
  };
  // Read again whenever the robot reports other ones.
  useEffect(load, [controller_checksum, parameters_checksum, link, boot_id]);
  if (problem.value) {
    return (
      <p class="failed" role="alert">
        {problem.value}{' '}
        <button type="button" onClick={load}>
          Try again
        </button>
      </p>
    );
  }
  if (said.value === null) return <p class="quiet">Reading what is in force …</p>;
  const { parameters, controller } = said.value;
  return (
    <div class="robot-in-force" tabIndex={0} role="region" aria-label={`In force on ${robot_id}`}>
      <dl>
        <dt>Controller</dt>
        <dd id="in-force-controller">{controller_text(controller)}</dd>
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
          {!parameters.is_current && ' · the robot is away: this was known last'}
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

export function controller_text({ controller, is_current }: ControllerInForce): string {
  if (controller === null) return 'not reported since the station started';
  const sections = [
    controller.pole && controller.pole.length > 0 && `${controller.pole.length} first-order sections`,
    controller.biquad_b0 && controller.biquad_b0.length > 0 && `${controller.biquad_b0.length} second-order sections`,
  ].filter(Boolean);
  const limits = `duty ${plain(controller.duty_min ?? null)} to ${plain(controller.duty_max ?? null)}`;
  const name = controller.controller_id === undefined ? '' : `number ${controller.controller_id} · `;
  const of = sections.length > 0 ? `, ${sections.join(', ')}` : '';
  const period = `every ${controller.period_us / 1000} ms`;
  return `${name}kp ${plain(controller.kp)}${of} · ${period} · ${limits}${is_current ? '' : ' · known last'}`;
}
