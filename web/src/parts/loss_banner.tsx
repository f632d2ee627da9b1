// That the database has lost commits, until an admin acknowledges it.

import type { Session } from '../session';

export function LossBanner({ session }: { session: Session }) {
  const { api, station, me, store } = session;
  const losses = station.value?.losses ?? [];
  if (losses.length === 0) return null;
  const acknowledge = async () => {
    try {
      await api.acknowledge_losses();
      station.value = await api.station();
    } catch (error) {
      store.note(error instanceof Error ? error.message : String(error));
    }
  };
  return (
    <span role="alert" id="losses">
      <strong class="exposed" title={losses.map((loss) => loss.problem).join('\n')}>
        The database has lost recordings: docs/operations.md
      </strong>
      {me.value?.role === 'admin' && (
        <button type="button" id="acknowledge-losses" onClick={() => void acknowledge()}>
          Acknowledge
        </button>
      )}
    </span>
  );
}
