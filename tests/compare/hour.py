#!/usr/bin/env python3
"""An hour of one robot in the table of the other stations: made, written as CSV, drawn as 2,000 points.

    hour.py make|csv|overview DATABASE
"""
import contextlib
import csv
import math
import sqlite3
import sys

import rows

SAMPLES, POINTS = 360_000, 2000


def make(path):
    with contextlib.closing(rows.open_database(path)) as database:
        database.execute("BEGIN")
        database.execute("INSERT INTO robot (name) VALUES ('load-1')")
        database.executemany(rows.INSERT, ((1, i, 10000 * i, i * 10, math.sin(i / 160), math.cos(i / 160), -math.sin(i / 160),
                                            math.sin(i / 50), 175 + i % 7, 0.1) for i in range(SAMPLES)))
        database.execute("COMMIT")


def main():
    what, path = sys.argv[1:]
    if what == "make":
        make(path)
        return
    with contextlib.closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
        if what == "csv":
            cursor = database.execute("SELECT seq, robot_time_us, received_at_ms, position_m, velocity_m_s, acceleration_m_s2,"
                                      " duty, impedance_mv, reference_m FROM sample WHERE robot_id = 1 ORDER BY seq")
            writer = csv.writer(sys.stdout)
            writer.writerow([column[0] for column in cursor.description])
            writer.writerows(cursor)
        else:
            width = SAMPLES / POINTS
            for row in database.execute("SELECT CAST(seq / ? AS INTEGER) AS point, min(position_m), max(position_m) FROM sample"
                                        " WHERE robot_id = 1 GROUP BY point", (width,)):
                print(*row)


if __name__ == "__main__":
    main()
