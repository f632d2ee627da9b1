-- The eleventh migration: the runs of one robot by time.
--
-- It adds an index: no row is rewritten. Whether a run holds an event of the station is asked of each that is old, and
-- the page lists the runs of one robot.
CREATE INDEX run_by_robot ON run(robot_id, started_at_us);
