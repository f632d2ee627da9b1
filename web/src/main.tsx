// Starts the cockpit: one session, one key that stops, one tree of views.

import './styles';
import { render } from 'preact';
import { keep_menus_shut, listen_for_stop_key } from './keys';
import { Session } from './session';
import { show_in_tab } from './tab';
import { Cockpit } from './views/cockpit';

const session = new Session();
listen_for_stop_key(window, session.stop_selected);
keep_menus_shut(window);
session.start();
show_in_tab(document, session);
render(<Cockpit session={session} />, document.getElementById('cockpit') as HTMLElement);
