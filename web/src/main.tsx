// Starts the cockpit: one session, one key that stops, one tree of views.

import '@fontsource/b612/latin-400.css';
import '@fontsource/b612/latin-700.css';
import '@fontsource/b612-mono/latin-400.css';
import '@fontsource/b612-mono/latin-700.css';
import 'uplot/dist/uPlot.min.css';
import './style/ground.css';
import './style/panels.css';
import './style/controls.css';
import { render } from 'preact';
import { listen_for_stop_key } from './keys';
import { Session } from './session';
import { Cockpit } from './views/cockpit';

const session = new Session();
listen_for_stop_key(window, session.stop_selected);
session.start();
render(<Cockpit session={session} />, document.getElementById('cockpit') as HTMLElement);
