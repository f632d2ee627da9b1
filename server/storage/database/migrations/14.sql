-- The fourteenth migration: what a run was made with, for good: its experiment with the profile that was performed, and the
-- designs whose controllers robots were sent.
--
-- It adds two tables, and fills the first one from the experiments that are still kept: no row is rewritten.
CREATE TABLE run_origin (               -- runs of experiments; stays when the experiment is forgotten
  run_id INTEGER PRIMARY KEY REFERENCES run,
  experiment_id INTEGER NOT NULL,
  number INTEGER NOT NULL,              -- of the run in its experiment, from 1
  variant TEXT NOT NULL,                -- JSON: fluid, controller, factors, repeat, step
  profile_sha256 TEXT,                  -- of profile; NULL: it has not been computed
  profile TEXT NOT NULL                 -- the document that was performed, TOML or JSON
);
INSERT OR IGNORE INTO run_origin
  SELECT run_id, experiment_id, number, variant, NULL, profile FROM experiment_run JOIN experiment USING (experiment_id)
  WHERE run_id IN (SELECT run_id FROM run);

CREATE TABLE design_sent (              -- controllers of designs that a robot was to be sent; a run has its checksum
  design_id INTEGER NOT NULL REFERENCES design,
  robot_id TEXT NOT NULL,
  controller_checksum INTEGER NOT NULL,
  first_at_us INTEGER NOT NULL,         -- when it was to be sent for the first time
  PRIMARY KEY (design_id, robot_id, controller_checksum)
) WITHOUT ROWID;
CREATE INDEX design_sent_by_robot ON design_sent(robot_id, controller_checksum);
CREATE INDEX design_by_model ON design(model_id);
