// The station: what it says of itself, how its recording does, and for admins who has access.

import { useSignal } from '@preact/signals';
import { useEffect } from 'preact/hooks';
import { Access } from './access';
import type { Recording, Station } from '../api';
import { age, bytes, clock_time, count } from '../format';
import type { ViewProps } from './table';

const kLook_ms = 5000;

export default function StationView({ session }: ViewProps) {
  const recording = useSignal<Recording | null>(null);
  const problem = useSignal('');
  const is_live = session.phase.value === 'live';
  useEffect(() => {
    if (!is_live) return;
    const look = async () => {
      try {
        session.station.value = await session.api.station();
        recording.value = await session.api.recording();
        problem.value = '';
      } catch (failure) {
        problem.value = failure instanceof Error ? failure.message : String(failure);
      }
    };
    void look();
    const timer = setInterval(() => void look(), kLook_ms);
    return () => clearInterval(timer);
  }, [is_live]);

  const station = session.station.value;
  const is_admin = session.me.value?.role === 'admin';
  return (
    <>
      <section class="view-head" aria-label="The station">
        <h1>Station</h1>
        <p class="problem" role="alert">
          {problem.value}
        </p>
      </section>
      <main class="view-body station-view" aria-label="Station">
        {station && <About station={station} />}
        {recording.value && <Storage recording={recording.value} />}
        {is_admin ? <Access session={session} /> : <p class="quiet">Accounts and tokens are shown to admins.</p>}
      </main>
    </>
  );
}

function About({ station }: { station: Station }) {
  const { security } = station;
  const { certificate } = security;
  return (
    <section aria-label="About" id="about-station">
      <h2>About</h2>
      <dl class="facts">
        <Fact name="Version">{station.version}</Fact>
        <Fact name="Runs for">{age(station.uptime_s * 1000)}</Fact>
        <Fact name="This page">
          {station.http_address} {security.http === 'tls' ? 'with TLS' : 'without TLS'}
        </Fact>
        <Fact name="Robots connect to">
          {station.robots_address} {security.robots === 'tls' ? 'with TLS' : 'without TLS'}
        </Fact>
        <Fact name="Certificate">
          {certificate
            ? `${certificate.names.join(', ')}, until ${new Date(certificate.not_after_us / 1000).toLocaleDateString()}`
            : 'none: no port speaks TLS'}
        </Fact>
        <Fact name="Database">{station.store_id}</Fact>
        <Fact name="Its clock">{clock_time(station.utc_us / 1000).slice(0, 8)}</Fact>
      </dl>
    </section>
  );
}

function Storage({ recording }: { recording: Recording }) {
  const { state, problem, free_bytes, database_bytes, queued_samples, counters } = recording;
  return (
    <section aria-label="Recording and storage" id="storage">
      <h2>Recording and storage</h2>
      <dl class="facts">
        <Fact name="State">
          {state === 'recording' ? 'recording' : `${state.replace('_', ' ')}: ${problem ?? 'the log says why'}`}
        </Fact>
        <Fact name="Database">{bytes(database_bytes)}</Fact>
        <Fact name="Free on its disk">{bytes(free_bytes)}</Fact>
        <Fact name="Not yet on disk">{count(queued_samples)} samples</Fact>
        <Fact name="Written">{count(counters.samples_written)} samples since the start</Fact>
        <Fact name="Lost for good">{count(counters.samples_lost)} samples since the start</Fact>
      </dl>
    </section>
  );
}

function Fact({ name, children }: { name: string; children: preact.ComponentChildren }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>{children}</dd>
    </div>
  );
}
