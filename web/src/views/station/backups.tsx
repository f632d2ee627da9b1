// Backups: which there are, one now, and how to restore one.

import { useSignal } from '@preact/signals';
import { bytes } from '../../format';
import { useActs, useAsked } from '../experiments/acts';
import type { Context } from './facts';
import { backup_name } from './moments';
import { Copyable, Field, Nothing, Panel, Problem } from './parts';
import { backup_problem, type Backup } from './station_api';

const kLook_ms = 2000;
const kPage_bytes = 4096;

export function Backups({ context }: { context: Context }) {
  const { session, api, is_admin, is_current, facts } = context;
  const asked = useAsked(session, api.backups, [], kLook_ms);
  const acts = useActs();
  const typed = useSignal('');
  const wrong = useSignal('');
  const backups = asked.answer ?? [];
  const is_under_way = backups.some(({ state }) => state === 'copying' || state === 'verifying');
  const is_full = facts?.recording.space === 'critical';
  const make = () => {
    const name = typed.value.trim() || backup_name(Date.now());
    wrong.value = backup_problem(name);
    if (wrong.value) return;
    void acts
      .act('backup', () => api.make_backup(name))
      .then((done) => {
        if (done) typed.value = '';
        asked.ask_again();
      });
  };
  const newest = [...backups].reverse().find(({ state }) => state === 'done');
  return (
    <div id="station-backups" class={is_current ? '' : 'was'}>
      <Problem text={asked.problem} />
      {is_admin ? (
        <form
          class="station-form"
          aria-label="Make a backup"
          onSubmit={(event) => {
            event.preventDefault();
            make();
          }}
        >
          <Field
            id="station-backup-name"
            label="Name of the backup"
            value={typed.value}
            hint={`${backup_name(Date.now()).slice(0, 15)}…`}
            max_length={64}
            is_wrong={wrong.value !== ''}
            on_input={(text) => {
              typed.value = text;
              wrong.value = '';
            }}
          />
          <button
            type="submit"
            id="station-make-backup"
            class="primary"
            disabled={acts.pending.value !== '' || is_under_way || is_full || !is_current}
          >
            Make a backup now
          </button>
          <p class="station-note">
            {is_full
              ? 'Not while the disk has so little room: see Storage.'
              : is_under_way
                ? 'One is under way; the next can begin when it is done.'
                : 'The station goes on recording meanwhile. Without a name it gets the time.'}
          </p>
        </form>
      ) : (
        <p class="station-lead quiet">An admin makes backups.</p>
      )}
      <Problem id="station-backup-problem" text={wrong.value || acts.problem.value} />
      <Panel id="station-backup-list" title="In the station’s backup folder">
        {backups.length === 0 ? (
          <Nothing is_known={asked.answer !== null}>
            <p>No backup yet.</p>
            <p class="quiet">A disk fails without notice: make one, and keep it on another disk.</p>
          </Nothing>
        ) : (
          <table class="station-table">
            <thead>
              <tr>
                <th scope="col">Name</th>
                <th scope="col">State</th>
                <th scope="col" class="number">
                  Size
                </th>
                <th scope="col">File</th>
              </tr>
            </thead>
            <tbody>
              {backups.map((backup) => (
                <Row key={backup.name} backup={backup} is_current={is_current} />
              ))}
            </tbody>
          </table>
        )}
        <p class="station-note">
          The station removes none of them: delete the files that you no longer need. A copy on the same disk is lost
          with that disk: set <code>recording.backup_dir</code> to another one.
        </p>
      </Panel>
      <Panel id="station-restore" title="To restore">
        <p class="station-note">
          Into a new folder, on the station’s machine. Users and tokens are those of the backup’s time: revoke again
          what was revoked since. Sessions are not restored.
        </p>
        <Copyable
          id="station-restore-line"
          label="the command that restores"
          text={`rheonaut restore --from ${newest?.path || 'BACKUP.sqlite'} --data rheonaut-restored`}
        />
        <Copyable
          id="station-serve-line"
          label="the command that serves it"
          text="rheonaut serve --data rheonaut-restored"
        />
      </Panel>
    </div>
  );
}

function Row({ backup, is_current }: { backup: Backup; is_current: boolean }) {
  const { name, state, pages_done, pages_total, problem, path } = backup;
  const share = pages_total > 0 ? pages_done / pages_total : 0;
  const is_moving = state === 'copying' || state === 'verifying';
  return (
    <tr data-backup={name} data-state={state}>
      <th scope="row">{name}</th>
      <td data-label="State">
        {state === 'failed' ? (
          <span class="station-word bad">failed: {problem ?? 'the station’s log says why'}</span>
        ) : state === 'done' ? (
          <span class="station-word good">complete and verified</span>
        ) : (
          <span class="station-progress">
            <progress max={1} value={share} aria-label={`Backup ${name}`} />
            {is_current ? '' : 'was '}
            {state} {state === 'copying' && `${Math.floor(100 * share)} %`}
          </span>
        )}
      </td>
      <td class="number" data-label="Size">
        {is_moving || pages_total > 0 ? bytes(pages_total * kPage_bytes) : '–'}
      </td>
      <td class="path" data-label="File">
        {path}
      </td>
    </tr>
  );
}
