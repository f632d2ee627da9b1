// Starts the cockpit: one session, one key that stops, one tree of views.

import './styles';
import { render } from 'preact';
import { listen_for_stop_key } from './keys';
import { Session } from './session';
import { Cockpit } from './views/cockpit';

const session = new Session();
listen_for_stop_key(window, session.stop_selected);
session.start();
render(<Cockpit session={session} />, document.getElementById('cockpit') as HTMLElement);
