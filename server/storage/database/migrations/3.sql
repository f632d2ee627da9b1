-- The third migration: how long each stage of a command took.
--
-- It adds columns only, so it takes no longer with a large database.

-- Steady time from the request's arrival at the station to each stage; NULL: not reached, or not known (version 2).
ALTER TABLE command ADD COLUMN sent_after_us INTEGER;
ALTER TABLE command ADD COLUMN acknowledged_after_us INTEGER;
ALTER TABLE command ADD COLUMN verified_after_us INTEGER;
ALTER TABLE command ADD COLUMN life_from TEXT NOT NULL DEFAULT '';  -- arrival, stamp, issued_at; empty: has no life

DROP VIEW robot_command;
CREATE VIEW robot_command AS
SELECT printf('%llu', command_id) AS command_id, robot_id, printf('%llu', boot_id) AS boot_id, kind, arguments, actor,
  state, reason, submitted_at_us, sent_at_us, ended_at_us, effect_at_robot_us,
  printf('%llu', emergency_id) AS emergency_id, sent_after_us, acknowledged_after_us, verified_after_us, life_from
FROM command;
