// The configuration in force, as far as the station's API says it; the rest is read on the station's machine.

import { bytes, count, duty_to_percent, fluid_text, m_to_millimetres } from '../../format';
import { useAsked } from '../experiments/acts';
import type { Context } from './facts';
import { Copyable, Fact, Nothing, Panel, Problem } from './parts';
import type { CommandLimits, FluidList } from './station_api';

export function Configuration({ context }: { context: Context }) {
  const { session, api, facts, is_current } = context;
  const fluids = useAsked(session, api.fluids, [], 0);
  const retention = facts?.recording.retention;
  return (
    <div id="station-configuration" class={is_current ? '' : 'was'}>
      <Problem text={fluids.problem || context.problem} />
      <Panel id="station-limits" title="Limits of commands, by the fluid that a robot is in">
        {fluids.answer ? <Limits known={fluids.answer} /> : <Nothing is_known={false}>{null}</Nothing>}
        <p class="station-note">
          <code>[limits]</code> and <code>[limits.FLUID]</code> of the configuration file set them. Who is in control of
          a robot sets its fluid; of one that is not known the strictest limits hold.
        </p>
      </Panel>
      {facts && retention && (
        <Panel id="station-settings" title="What else the station reports">
          <dl class="facts">
            <Fact name="http">{facts.station.http_address}</Fact>
            <Fact name="robots">{facts.station.robots_address}</Fact>
            <Fact name="tls">
              http {facts.station.security.http}, robots {facts.station.security.robots}
            </Fact>
            <Fact name="retention_days">
              {retention.retention_days === 0 ? '0, samples are kept for ever' : count(retention.retention_days)}
            </Fact>
            <Fact name="event_retention_days">
              {retention.event_retention_days === 0
                ? '0, events are kept for ever'
                : count(retention.event_retention_days)}
            </Fact>
            <Fact name="max_database_mb">
              {retention.max_database_bytes === 0 ? '0, no limit' : bytes(retention.max_database_bytes)}
            </Fact>
          </dl>
        </Panel>
      )}
      <Panel id="station-file" title="Everything else">
        <p class="station-note">
          The station does not serve its whole configuration. On its machine this prints the values of a configuration
          file with all defaults, and says what is wrong in it, with the line:
        </p>
        <Copyable
          id="station-check-config"
          label="the command that checks the configuration"
          text="rheonaut check-config --config rheonaut.toml --data FOLDER"
        />
        <p class="station-note">
          <code>deploy/rheonaut.toml</code> documents every option. A change is in force after a restart of the station.
          What was in force in a run is in the run’s snapshot.
        </p>
      </Panel>
    </div>
  );
}

const millimetre_text = (length_m: number) => `${count(m_to_millimetres(length_m))}`;
const range = (low: number, high: number, text: (value: number) => string) => `${text(low)} to ${text(high)}`;
const percent_text = (duty: number) => count(duty_to_percent(duty));

function Limits({ known }: { known: FluidList }) {
  const rows: { name: string; title: string; limits: CommandLimits }[] = [
    ...known.fluids.map(({ fluid, limits }) => ({ name: fluid, title: fluid_text(fluid), limits })),
    { name: 'unknown', title: 'not known', limits: known.limits_where_unknown },
  ];
  return (
    <table class="station-table">
      <thead>
        <tr>
          <th scope="col">Fluid</th>
          <th scope="col" class="number">
            Setpoint, mm
          </th>
          <th scope="col" class="number">
            Largest step, mm
          </th>
          <th scope="col" class="number">
            Duty, %
          </th>
          <th scope="col" class="number">
            At power
          </th>
          <th scope="col" class="number">
            Disturbance, mm
          </th>
        </tr>
      </thead>
      <tbody>
        {rows.map(({ name, title, limits }) => (
          <tr key={name} data-fluid={name}>
            <th scope="row">{title}</th>
            <td class="number" data-label="Setpoint, mm">
              {range(limits.setpoint_min_m, limits.setpoint_max_m, millimetre_text)}
            </td>
            <td class="number" data-label="Largest step, mm">
              {millimetre_text(limits.setpoint_step_m)}
            </td>
            <td class="number" data-label="Duty, %">
              {range(limits.duty_min, limits.duty_max, percent_text)}
            </td>
            <td class="number" data-label="At power">
              {count(limits.power_s)} s above {percent_text(limits.power_duty)} %
            </td>
            <td class="number" data-label="Disturbance, mm">
              {millimetre_text(limits.disturbance_max_m)}
            </td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
