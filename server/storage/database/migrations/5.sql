-- The fifth migration adds the audit: who did what, when and from where, chained by hashes.
--
-- It adds columns and a table: no row is rewritten. Commands that have ended have no entry; meta says how many.

CREATE TABLE audit (
  entry INTEGER PRIMARY KEY,     -- 1, 2, 3 and so on, without holes
  at_us INTEGER NOT NULL,        -- UTC when it happened; entries are in the order in which they were written
  actor TEXT NOT NULL,           -- who
  peer TEXT NOT NULL,            -- from which address; '': from none
  robot_id TEXT NOT NULL,        -- '': the station itself
  action TEXT NOT NULL,
  subject TEXT NOT NULL,
  detail TEXT NOT NULL,          -- JSON object
  salt BLOB NOT NULL,            -- 16 random bytes: whoever knows only content_hash cannot guess the content
  content_hash BLOB NOT NULL,    -- BLAKE2b-256 of at_us to salt
  hash BLOB NOT NULL             -- BLAKE2b-256 of the hash before, entry and content_hash
);
CREATE INDEX audit_by_time ON audit(at_us);

CREATE TRIGGER audit_in_order BEFORE INSERT ON audit
WHEN NEW.entry IS NOT (SELECT coalesce(max(entry), 0) + 1 FROM audit)
BEGIN SELECT RAISE(ABORT, 'entries of the audit are numbered without holes'); END;
CREATE TRIGGER audit_unchanged BEFORE UPDATE ON audit
BEGIN SELECT RAISE(ABORT, 'entries of the audit are never changed'); END;
CREATE TRIGGER audit_kept BEFORE DELETE ON audit
BEGIN SELECT RAISE(ABORT, 'entries of the audit are never removed'); END;

ALTER TABLE command ADD COLUMN peer TEXT NOT NULL DEFAULT '';  -- the address that it came from
ALTER TABLE command ADD COLUMN audit_entry INTEGER;            -- that says what this row says; NULL: older than the audit
INSERT INTO meta (name, value)
  SELECT 'commands_before_audit', count(*) FROM command WHERE state NOT IN ('queued', 'sent');
