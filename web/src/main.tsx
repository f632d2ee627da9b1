// Starts the cockpit: one session, one key that stops, one tree of views.

import './styles';
import { render } from 'preact';
import { pause_count_downs } from './count_downs';
import { listen_for_stop_of_pads } from './gamepad';
import { keep_menus_shut, listen_for_any_press, listen_for_stop_key, listen_for_view_keys } from './keys';
import { follow_build, served_html } from './page_build';
import { follow_address } from './route';
import { Session } from './session';
import { show_in_tab } from './tab';
import { Cockpit, open_view } from './views/cockpit';
import { link_code } from './views/signed_out';

const session = new Session();
follow_address(window);
listen_for_stop_key(window, session.stop_selected);
listen_for_stop_of_pads(session.stop_selected);
listen_for_view_keys(window, open_view);
listen_for_any_press(window, () => pause_count_downs(session));
keep_menus_shut(window);
follow_build({
  own_html: document.documentElement.outerHTML,
  phase: session.phase,
  served_html,
  set_timer: (callback, delay_ms) => setTimeout(callback, delay_ms),
});
if (link_code() === null) session.start(); // the page of a link shows no cockpit before it is redeemed
show_in_tab(document, session);
render(<Cockpit session={session} />, document.getElementById('cockpit') as HTMLElement);
