// The views of the page, in the order of the navigation. A view that is not in this table does not exist for anybody.
//
// To add one: write views/NAME.tsx and give it a line here. Its default export is drawn beside the stop button; it lays
// out `.view-head` (beside the stop) and `.view-body` (below, over the whole width), see style/shell.css. What its
// optional export Hands draws stands below the stop button. Its styles belong to styles.ts, so that they are never missing.

import type { ComponentType } from 'preact';
import type { Route } from '../route';
import type { Session } from '../session';

export interface ViewProps {
  session: Session;
  route: Route;
}

export interface ViewModule {
  default: ComponentType<ViewProps>;
  Hands?: ComponentType<ViewProps>;
  has_hands?(route: Route): boolean; // where not every address of the view has something there
}

export interface View {
  name: string; // the first part of its address
  title: string;
  key: string; // pressed after "g"
  load(): Promise<ViewModule>;
}

export const kViews: readonly View[] = [
  { name: 'fleet', title: 'Fleet', key: 'f', load: () => import('./fleet') },
  { name: 'robot', title: 'Robot', key: 'r', load: () => import('./robot') },
  { name: 'runs', title: 'Runs', key: 'u', load: () => import('./runs/view') },
  { name: 'experiments', title: 'Experiments', key: 'e', load: () => import('./experiments') },
  { name: 'design', title: 'Design', key: 'd', load: () => import('./design') },
  { name: 'station', title: 'Station', key: 's', load: () => import('./station') },
];

export const view_named = (name: string) => kViews.find((view) => view.name === name);
