// About the station: its version, its database, its clock, its API; and where its log is.

import { format } from '../../route';
import type { Context } from './facts';
import { moment_text, span_text } from './moments';
import { Copyable, Fact, Nothing, Panel, Problem } from './parts';

export function About({ context }: { context: Context }) {
  const { facts, problem, is_current, is_utc, session } = context;
  if (!facts) return problem ? <Problem text={problem} /> : <Nothing is_known={false}>{null}</Nothing>;
  const { station } = facts;
  const me = session.me.value;
  return (
    <div id="station-about" class={is_current ? '' : 'was'}>
      <div class="station-columns">
        <Panel id="station-program" title="Rheonaut">
          <dl class="facts">
            <Fact name="Version">{station.version}</Fact>
            <Fact name="Runs for">{span_text(station.uptime_s)}</Fact>
            <Fact name="Started">{moment_text(station.utc_us - station.uptime_s * 1e6, is_utc, true)}</Fact>
            <Fact name="Its clock">{moment_text(station.utc_us, is_utc, true)}</Fact>
            <Fact name="Database">
              <code>{station.store_id}</code>
            </Fact>
            <Fact name="This page">{station.http_address}</Fact>
            <Fact name="Robots connect to">{station.robots_address}</Fact>
            <Fact name="You">
              {me ? `${me.actor}, ${me.role}` : '–'}{' '}
              <span class="quiet">{me && `(${me.scopes.replaceAll(',', ', ')})`}</span>
            </Fact>
          </dl>
        </Panel>
        <Panel id="station-api" title="For scripts">
          <p class="station-note">
            A script can do everything that this page does. The station describes its API itself:
          </p>
          <p>
            <a class="button" id="station-openapi" href="/api/v1/openapi.yaml" download="rheonaut-openapi.yaml">
              openapi.yaml
            </a>
          </p>
          <p class="station-note">
            <a href="/metrics" target="_blank" rel="noreferrer">
              /metrics
            </a>{' '}
            has the station’s figures for Prometheus;{' '}
            <a href={format({ view: 'station', parts: ['tokens'] })}>tokens</a> let scripts in.
          </p>
          <p class="station-note">
            What this page is made of, with its licences:{' '}
            <a href="/licences.txt" target="_blank" rel="noreferrer">
              licences.txt
            </a>
          </p>
        </Panel>
      </div>
    </div>
  );
}

export function Log({ context }: { context: Context }) {
  return (
    <div id="station-log" class={context.is_current ? '' : 'was'}>
      <Panel id="station-log-where" title="The station’s own log">
        <p>The station writes its log to its standard output. It does not serve it, so this page cannot show it.</p>
        <p class="station-note">
          On the station’s machine, where systemd starts it, for example as the service “rheonaut”:
        </p>
        <Copyable id="station-journal" label="the command that follows the log" text="journalctl -u rheonaut -f" />
        <p class="station-note">Started by hand, it is in that terminal. To keep it in a file as well:</p>
        <Copyable
          id="station-tee"
          label="the command that keeps the log"
          text="rheonaut serve --data FOLDER 2>&1 | tee -a rheonaut.log"
        />
      </Panel>
      <Panel id="station-log-else" title="What is recorded elsewhere">
        <dl class="facts">
          <Fact name="Who did what">
            <a href={format({ view: 'station', parts: ['audit'] })}>Audit</a>: commands, refusals, sign-ins, changes,
            starts and stops of the station
          </Fact>
          <Fact name="What robots report">
            <a href={format({ view: 'robot' })}>Robot</a>: events, commands and their outcomes, below the plots
          </Fact>
          <Fact name="What is wrong now">
            <a href={format({ view: 'station', parts: ['health'] })}>Health</a>, and the alarms in the status line
          </Fact>
        </dl>
      </Panel>
    </div>
  );
}
