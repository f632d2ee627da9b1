-- The sixth migration keeps how many events a boot has announced, so that those which never came are listed.
--
-- It adds a column: no row is rewritten.

ALTER TABLE boot ADD COLUMN announced_next_event_seq INTEGER NOT NULL DEFAULT 0;  -- at least so many were made; 0: not known
