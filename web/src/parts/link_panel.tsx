// The quality of the link and the health of the robot, as a column of figures; of the recording one line, with its figures
// on demand.

import { useSignal } from '@preact/signals';
import { count, milliseconds_of_us, percent, volts_of_mv } from '../format';
import { recording_line } from '../recording_line';
import { changed_limits_of, type Robot } from '../robot';

const kNotReported = null; // rssi_dbm 0, supply_mv null: the robot does not measure it

export function LinkPanel({ robot, is_current = true }: { robot: Robot; is_current?: boolean }) {
  const state = robot.state.value;
  const { stale } = robot.readout.value;
  const { status, clock } = state;
  const fill = status && state.ring_capacity > 0 ? status.ring_fill / state.ring_capacity : null;
  return (
    <section class={`link-panel ${stale ? 'stale' : ''}`} aria-label="Link and health">
      <h2>Link</h2>
      <dl>
        <Figure name="Round trip" unit="ms" value={milliseconds_of_us(clock?.round_trip_us)} />
        <Figure
          name="Clock ±"
          unit="ms"
          value={milliseconds_of_us(clock?.uncertainty_us, 2)}
          title="Uncertainty of the robot's clock against the station's"
        />
      </dl>
      <h2>Recording</h2>
      <RecordingFigures robot={robot} is_current={is_current} />
      <h2>Robot</h2>
      {changed_limits_of(state) && <p id="changed-limits">{changed_limits_of(state)}</p>}
      <dl>
        <Figure
          name="Buffer"
          unit="%"
          value={percent(fill, 0)}
          tone={(fill ?? 0) > 0.8 ? 'caution' : ''}
          title="Fill of the robot's ring of samples"
        />
        <Figure
          name="Supply"
          unit="V"
          value={status?.supply_mv === null ? kNotReported : volts_of_mv(status?.supply_mv)}
        />
        <Figure name="Signal" unit="dBm" value={status?.rssi_dbm === 0 ? kNotReported : count(status?.rssi_dbm)} />
        <Figure
          name="Missed ticks"
          unit=""
          value={count(status?.missed_ticks)}
          tone={(status?.missed_ticks ?? 0) > 0 ? 'caution' : 'on-desk-only'}
        />
      </dl>
    </section>
  );
}

function RecordingFigures({ robot, is_current }: { robot: Robot; is_current: boolean }) {
  const open = useSignal(false);
  const state = robot.state.value;
  const { received, missing } = robot.readout.value;
  const line = recording_line(state, is_current);
  const lost = state.status?.lost_samples ?? 0;
  const lag = Math.max(0, state.next_seq - state.durable_next_seq);
  return (
    <div class="recording-figures">
      <button
        type="button"
        id="recording-line"
        class={line.tone}
        aria-expanded={open.value}
        aria-controls="recording-details"
        onClick={() => (open.value = !open.value)}
      >
        {line.text}
      </button>
      {open.value && (
        <dl id="recording-details">
          <Figure name="Shown here" unit="" value={count(received)} title="Samples that this page has received" />
          <Figure
            name="Missed here"
            unit=""
            value={count(missing)}
            tone={missing > 0 ? 'caution' : ''}
            title="Samples that this page has not received; the recording has its own count"
          />
          <Figure
            name="Lost for good"
            unit=""
            value={count(lost)}
            tone={lost > 0 ? 'alarm' : ''}
            title="Overwritten on the robot before the station had them on disk"
          />
          <Figure
            name="Not yet on disk"
            unit=""
            value={count(lag)}
            tone={lag > 200 ? 'caution' : ''}
            title="Samples received but not yet durable"
          />
        </dl>
      )}
    </div>
  );
}

function Figure(props: { name: string; unit: string; value: string | null; tone?: string; title?: string }) {
  return (
    <div class={props.tone ?? ''} title={props.title}>
      <dt>{props.name}</dt>
      {props.value === null ? (
        <dd class="quiet">not reported</dd>
      ) : (
        <dd>
          {props.value}
          <span class="unit">{props.unit}</span>
        </dd>
      )}
    </div>
  );
}
