-- The twelfth migration: how many ticks of a run the robot missed, which robots are owed rest, which parts of runs were
-- interrupted, and since when a token has expired.
--
-- It adds three columns, a table and an index: no row is rewritten. A digest of an older version has NULL there until the
-- station has counted them from the heads of its segments; what a digest hashes stays.
ALTER TABLE run_certificate ADD COLUMN missed_ticks INTEGER;          -- at which the robot made no sample; NULL: not counted
ALTER TABLE run_certificate ADD COLUMN longest_missed_ticks INTEGER;  -- in a row

CREATE TABLE rest_owed (              -- robots that move in a name whose right has ended, and were not seen at rest since
  robot_id TEXT PRIMARY KEY REFERENCES robot,
  boot_id INTEGER NOT NULL,           -- that moves so; a later one is at rest
  why TEXT NOT NULL,                  -- what has ended the right
  since_us INTEGER NOT NULL
) WITHOUT ROWID;

ALTER TABLE api_token ADD COLUMN expired_at_us INTEGER NOT NULL DEFAULT 0;  -- since when it is refused; 0: it is not

-- The parts of its runs in which an experiment was interrupted are events of the station; each run is asked for them.
CREATE INDEX event_of_interruption ON event(boot_key, robot_time_us) WHERE kind = 'experiment_interrupted';
