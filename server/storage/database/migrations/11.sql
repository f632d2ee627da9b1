-- The eleventh migration: the runs of one robot by time, and the stops of one boot.
--
-- It adds indices: no row is rewritten. Whether a run holds an event of the station is asked of each that is old, and
-- the page lists the runs of one robot.
CREATE INDEX run_by_robot ON run(robot_id, started_at_us);

-- What a boot was last stopped by is asked at each start.
CREATE INDEX command_stop ON command(boot_id, effect_at_robot_us) WHERE kind = 'emergency_stop';
