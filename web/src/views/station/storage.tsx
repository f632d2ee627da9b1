// Storage: how large the database is, how fast it grows, when the disk is full, and what retention removes.

import { bytes, count } from '../../format';
import { format } from '../../route';
import type { Context } from './facts';
import { span_text } from './moments';
import { bytes_per_day, full_in_s, is_within_disk, kBytesOfSample } from './pace';
import { Copyable, Fact, Nothing, Panel, Problem } from './parts';

export function Storage({ context }: { context: Context }) {
  const { facts, problem, is_current } = context;
  if (!facts) return problem ? <Problem text={problem} /> : <Nothing is_known={false}>{null}</Nothing>;
  const { recording, pace } = facts;
  const { retention, counters } = recording;
  const full_s = pace && full_in_s(pace, recording.free_bytes);
  const is_bounded = retention.max_database_bytes > 0;
  return (
    <div id="station-storage" class={is_current ? '' : 'was'}>
      <dl class="station-figures">
        <Fact name="Database" id="station-database">
          {bytes(recording.database_bytes)}
        </Fact>
        <Fact name="Free on its disk">
          <span class={recording.space === 'ok' ? '' : recording.space === 'low' ? 'caution' : 'bad'}>
            {bytes(recording.free_bytes)}
          </span>
        </Fact>
        <Fact name="Grows by, at this pace">
          {!pace ? 'measuring…' : pace.samples_per_s === 0 ? 'nothing' : `${bytes(bytes_per_day(pace))} a day`}
        </Fact>
        <Fact name="Disk full in about">
          {is_within_disk(recording)
            ? 'never'
            : !pace
              ? 'measuring…'
              : full_s === null
                ? 'no samples come'
                : span_text(full_s)}
        </Fact>
      </dl>
      <p class="station-lead quiet">
        The pace is{' '}
        {pace ? `${count(pace.samples_per_s)} samples/s over the last ${span_text(pace.over_s)}` : 'being counted'}, at
        about {kBytesOfSample} bytes a sample.{' '}
        {is_bounded && `The database is kept below ${bytes(retention.max_database_bytes)}.`}
      </p>
      <div class="station-columns">
        <Panel id="station-retention" title="Retention">
          <dl class="facts">
            <Fact name="Samples are kept">
              {retention.retention_days === 0
                ? is_bounded
                  ? 'until the database is too large'
                  : 'for ever'
                : `${count(retention.retention_days)} days`}
            </Fact>
            <Fact name="Events are kept">
              {retention.event_retention_days === 0 ? 'for ever' : `${count(retention.event_retention_days)} days`}
            </Fact>
            <Fact name="Largest database">{is_bounded ? bytes(retention.max_database_bytes) : 'no limit'}</Fact>
            <Fact name="Removed">
              {count(retention.samples_purged)} samples and {count(retention.events_purged)} events since the start
            </Fact>
            <Fact name="Given back">{bytes(retention.bytes_returned)} to the file system</Fact>
            <Fact name="Longest step">{retention.longest_step_ms.toFixed(1)} ms between two commits</Fact>
            {retention.all_held && (
              <Fact name="Limit">
                <span class="caution">
                  cannot be reached: runs hold all that is left. Discard runs, or raise max_database_mb.
                </span>
              </Fact>
            )}
          </dl>
          <p class="station-note">
            Samples and events of runs are kept until the run is discarded; commands and the audit always. To change it,
            set <code>recording.retention_days</code>, <code>recording.event_retention_days</code> or{' '}
            <code>recording.max_database_mb</code> in the configuration file and restart the station.
          </p>
        </Panel>
        <Panel id="station-writing" title="Writing">
          <dl class="facts">
            <Fact name="Not yet on disk">{count(recording.queued_samples)} samples</Fact>
            <Fact name="Written">{count(counters.samples_written)} samples since the start</Fact>
            <Fact name="Lost for good">{count(counters.samples_lost)} samples since the start</Fact>
            <Fact name="Received twice">{count(counters.samples_duplicate)} samples</Fact>
            <Fact name="Asked for again">
              {count(counters.samples_refused)} samples, {count(counters.events_asked_again)} requests of events
            </Fact>
            <Fact name="Commits">
              {count(counters.commits)}, {count(counters.commits_failed)} failed; the largest had{' '}
              {count(counters.largest_commit_samples)} samples
            </Fact>
            <Fact name="Write-ahead log">
              {bytes(recording.wal_bytes)} of at most 128 MB
              {recording.wal_held_s > 0 && `, held by another program for ${span_text(recording.wal_held_s)}`}
            </Fact>
          </dl>
        </Panel>
      </div>
      <Panel id="station-shrink" title="To make the file smaller">
        <p class="station-note">
          New samples use the space that is free in the file. To shrink it once, stop the station and run this in its
          data folder. A backup first: <a href={format({ view: 'station', parts: ['backups'] })}>Backups</a>.
        </p>
        <Copyable id="station-vacuum" label="the command that shrinks the file" text="sqlite3 station.sqlite VACUUM" />
      </Panel>
    </div>
  );
}
