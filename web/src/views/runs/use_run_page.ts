// Loads a run while a view shows it, and again and again while it is open.

import { useEffect } from 'preact/hooks';
import type { Session } from '../../session';
import type { RunPage } from './run_page';

const kRefresh_ms = 5000; // of a run that is open, and of what could not be read

export function useRunPage(session: Session, page: RunPage): void {
  const is_live = session.phase.value === 'live';
  const is_open = page.run.value?.state === 'open';
  useEffect(() => {
    if (!is_live) return;
    void page.load();
    if (!is_open) return;
    const timer = setInterval(() => void page.load(), kRefresh_ms);
    return () => clearInterval(timer);
  }, [page, is_live, is_open]);
  const is_unread = page.unread.value !== '';
  useEffect(() => {
    if (!is_live || is_open || !is_unread) return;
    const timer = setInterval(() => void page.load_what_happened(), kRefresh_ms);
    return () => clearInterval(timer);
  }, [page, is_live, is_open, is_unread]);
}
