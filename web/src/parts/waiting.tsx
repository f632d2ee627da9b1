// Where no robot is known yet: how one comes.

import type { Session } from '../session';

export function Waiting({ session }: { session: Session }) {
  const address = session.station.value?.robots_address;
  return (
    <div class="waiting">
      <h2>No robot yet</h2>
      <p>
        Robots connect to the station by themselves
        {address && (
          <>
            , at <code>{address}</code>
          </>
        )}
        . The first one that does is shown here.
      </p>
      <p>
        A simulated one, on the machine of the station:
        <br />
        <code>rheonaut-sim --station {address ?? 'ADDRESS'} --id sim-1</code>
      </p>
    </div>
  );
}
