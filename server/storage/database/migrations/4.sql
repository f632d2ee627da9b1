-- The fourth migration adds accounts: users, API tokens, sessions of pages, and how each robot was enrolled.
--
-- It adds columns and tables only: no row is rewritten.

CREATE TABLE user (
  name TEXT PRIMARY KEY,
  role TEXT NOT NULL CHECK (role IN ('viewer', 'operator', 'admin')),
  password_hash TEXT NOT NULL,          -- Argon2id with its salt and cost, as libsodium writes it
  made_at_us INTEGER NOT NULL,
  made_by TEXT NOT NULL,                -- the actor
  disabled INTEGER NOT NULL DEFAULT 0   -- may not sign in
) WITHOUT ROWID;

CREATE TABLE api_token (
  name TEXT PRIMARY KEY,
  hash BLOB NOT NULL UNIQUE,            -- BLAKE2b-256
  scopes TEXT NOT NULL,                 -- of read, stop, record, command, admin: 'read,stop'
  owner TEXT NOT NULL,                  -- a user, whose role bounds it; '': the station
  made_at_us INTEGER NOT NULL,
  last_used_at_us INTEGER NOT NULL,     -- to the minute; 0: never
  expires_at_us INTEGER NOT NULL,       -- 0: never
  revoked_at_us INTEGER NOT NULL        -- 0: it is good
) WITHOUT ROWID;

CREATE TABLE page_session (
  session INTEGER PRIMARY KEY,          -- never given twice: meta holds next_session
  hash BLOB NOT NULL UNIQUE,            -- BLAKE2b-256 of the cookie
  user TEXT NOT NULL,                   -- '': let in by a one-time link
  made_at_us INTEGER NOT NULL,
  last_used_at_us INTEGER NOT NULL,     -- to the hour
  ends_at_us INTEGER NOT NULL,
  peer TEXT NOT NULL,                   -- the address it was made from
  agent TEXT NOT NULL                   -- what the browser said it was
);

ALTER TABLE robot ADD COLUMN enrolled_by TEXT NOT NULL DEFAULT 'loopback';  -- the actor; 'loopback': by itself
ALTER TABLE robot ADD COLUMN revoked_at_us INTEGER;                         -- NULL: it may connect
ALTER TABLE robot ADD COLUMN revoked_by TEXT;
