// The hour of hour.py, read in Node: as CSV, or as 2,000 points.
//
//   node hour.mjs csv|overview DATABASE
import { createRequire } from "node:module";
import { writeSync } from "node:fs";

const Database = createRequire(`${process.env.COMPARE_NODE_MODULES ?? process.cwd()}/`)("better-sqlite3");
const [what, path] = process.argv.slice(2);
const database = new Database(path, { readonly: true });
const BATCH = 1000;
let waiting = [];

function write(line) {
  waiting.push(line);
  if (waiting.length === BATCH) flush();
}

function flush() {
  if (waiting.length) writeSync(1, waiting.join("\n") + "\n");
  waiting = [];
}

if (what === "csv") {
  const select = database.prepare(`SELECT seq, robot_time_us, received_at_ms, position_m, velocity_m_s, acceleration_m_s2,
    duty, impedance_mv, reference_m FROM sample WHERE robot_id = 1 ORDER BY seq`);
  write(select.columns().map((column) => column.name).join(","));
  for (const row of select.raw().iterate()) write(row.join(","));
} else {
  const select = database.prepare(`SELECT CAST(seq / 180.0 AS INTEGER) AS point, min(position_m), max(position_m) FROM sample
    WHERE robot_id = 1 GROUP BY point`);
  for (const row of select.raw().iterate()) write(row.join(" "));
}
flush();
