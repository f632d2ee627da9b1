// The view of runs: the list, one run, or several beside each other.

import { shows_past } from '../../past_guard';
import type { Route } from '../../route';
import type { Session } from '../../session';
import type { ViewProps } from '../table';
import { CompareHands, CompareView } from './compare_view';
import { RunList } from './list_view';
import { RunHands, RunView } from './run_view';
import { RunsApi } from './runs_api';

let api: RunsApi | null = null;
const api_of = (session: Session) => (api ??= new RunsApi(session.api));

export default function RunsView({ session, route }: ViewProps) {
  const [what] = route.parts;
  const asks = api_of(session);
  if (what === undefined) return <RunList session={session} api={asks} route={route} />;
  if (what === 'compare') return <CompareView session={session} api={asks} route={route} />;
  return <RunView key={what} session={session} api={asks} route={route} />;
}

// SAFETY: beside a replay stands the stop and nothing else.
export const has_hands = (route: Route): boolean => !shows_past(route);

export function Hands({ session, route }: ViewProps) {
  const [what] = route.parts;
  if (what === undefined) return null;
  if (what === 'compare') return <CompareHands session={session} api={api_of(session)} route={route} />;
  return <RunHands key={what} session={session} api={api_of(session)} route={route} />;
}
