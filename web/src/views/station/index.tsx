// The station: how it does, who has access, what was done, and how it is set up, each in a section with an address.
//
//   #/station   #/station/health   #/station/robots   #/station/audit?action=account&actor=user:anna/session:4

import type { ComponentType } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { format } from '../../route';
import type { Session } from '../../session';
import type { ViewProps } from '../table';
import { About, Log } from './about';
import { Accounts } from './accounts';
import { Audit } from './audit';
import { Backups } from './backups';
import { Certificate } from './certificate';
import { Configuration } from './configuration';
import { use_utc, useFacts, useHealth, type Context } from './facts';
import { summary_of } from './health';
import { HealthView } from './health_view';
import { span_text } from './moments';
import { ClockSwitch, WordMark } from './parts';
import { Robots } from './robots';
import { Sessions } from './sessions';
import { StationApi } from './station_api';
import { Storage } from './storage';
import { Tokens } from './tokens';

interface SectionProps {
  context: Context;
}

interface Section {
  part: string;
  title: string;
  of: ComponentType<SectionProps>;
  has_times?: true; // that the switch of the clock changes
}

const kGroups: readonly { title: string; sections: readonly Section[] }[] = [
  {
    title: 'Now',
    sections: [
      { part: 'health', title: 'Health', of: HealthView },
      { part: 'storage', title: 'Storage', of: Storage },
      { part: 'backups', title: 'Backups', of: Backups },
    ],
  },
  {
    title: 'Access',
    sections: [
      { part: 'accounts', title: 'Accounts', of: Accounts, has_times: true },
      { part: 'sessions', title: 'Sessions', of: Sessions, has_times: true },
      { part: 'tokens', title: 'Tokens', of: Tokens, has_times: true },
      { part: 'robots', title: 'Robots', of: Robots, has_times: true },
    ],
  },
  {
    title: 'Record',
    sections: [
      { part: 'audit', title: 'Audit', of: Audit, has_times: true },
      { part: 'log', title: 'Log', of: Log },
    ],
  },
  {
    title: 'Set-up',
    sections: [
      { part: 'certificate', title: 'Certificate', of: Certificate, has_times: true },
      { part: 'configuration', title: 'Configuration', of: Configuration },
      { part: 'about', title: 'About', of: About, has_times: true },
    ],
  },
];
const kSections = kGroups.flatMap(({ sections }) => sections);

let kept_api: StationApi | null = null;
const api_of = (session: Session) =>
  (kept_api ??= new StationApi(session.api, (path, options) => fetch(path, options)));

export default function StationView({ session, route }: ViewProps) {
  const api = api_of(session);
  const { facts, problem } = useFacts(session, api);
  const is_utc = use_utc();
  const is_current = session.store.is_current.value && session.phase.value === 'live' && problem === '';
  const context: Context = {
    session,
    api,
    facts,
    problem,
    is_current,
    is_admin: session.me.value?.role === 'admin',
    is_utc,
    query: route.query,
  };
  const part = route.parts[0] ?? 'health';
  const section = kSections.find((each) => each.part === part);
  const Body = section?.of;
  return (
    <>
      <section class="view-head station-head" aria-label="The station">
        <div class="station-title">
          <h1>Station</h1>
          <Summary context={context} />
        </div>
        <Sections part={part} />
      </section>
      <main class="view-body station-view" aria-label={`Station, ${section?.title ?? 'nothing'}`} tabIndex={0}>
        <header class="station-section">
          <h2>{section?.title ?? 'Nothing is at this address'}</h2>
          {section?.has_times && <ClockSwitch is_utc={is_utc} />}
        </header>
        {problem !== '' && facts && (
          <p class="station-problem" role="alert">
            {problem} This is what was known last.
          </p>
        )}
        {Body ? <Body key={part} context={context} /> : <NoSection part={part} />}
      </main>
    </>
  );
}

function Summary({ context }: { context: Context }) {
  const { facts } = context;
  const { word, text } = summary_of(useHealth(context));
  return (
    <p class="station-summary">
      <a id="station-summary" href={format({ view: 'station', parts: ['health'] })} data-word={word}>
        <WordMark word={word}>{text}</WordMark>
      </a>
      {facts && (
        <span class="quiet">
          version {facts.station.version}, runs for {span_text(facts.station.uptime_s)}
        </span>
      )}
    </p>
  );
}

function Sections({ part }: { part: string }) {
  const nav = useRef<HTMLElement>(null);
  useEffect(() => {
    // On a phone it is a strip: the section that is open stands in sight.
    const show = () => {
      const current = nav.current?.querySelector<HTMLElement>('[aria-current]');
      if (nav.current && current) nav.current.scrollLeft = current.offsetLeft - nav.current.clientWidth / 3;
    };
    show();
    addEventListener('resize', show);
    return () => removeEventListener('resize', show);
  }, [part]);
  return (
    <nav class="station-sections" aria-label="Sections of the station" ref={nav}>
      {kGroups.map(({ title, sections }) => (
        <div key={title}>
          <h2>{title}</h2>
          <ul>
            {sections.map((each) => (
              <li key={each.part}>
                <a
                  id={`station-open-${each.part}`}
                  href={format({ view: 'station', parts: [each.part] })}
                  aria-current={each.part === part ? 'page' : undefined}
                >
                  {each.title}
                </a>
              </li>
            ))}
          </ul>
        </div>
      ))}
    </nav>
  );
}

function NoSection({ part }: { part: string }) {
  return (
    <p id="station-no-section">
      “{part}” is no section of the station. <a href={format({ view: 'station', parts: ['health'] })}>Health</a>
    </p>
  );
}
