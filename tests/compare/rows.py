"""The table of the other stations, and how Python writes it: durable as Rheonaut's, one commit each 100 ms."""
import sqlite3
import struct
import time

COMMIT_S = 0.1
INSERT = "INSERT OR IGNORE INTO sample VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"


def open_database(path):
    database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    database.execute("PRAGMA journal_mode = WAL")
    database.execute("PRAGMA synchronous = FULL")  # what is committed survives a power cut
    database.execute("CREATE TABLE IF NOT EXISTS robot (robot_id INTEGER PRIMARY KEY, name TEXT UNIQUE)")
    database.execute(
        "CREATE TABLE IF NOT EXISTS sample (robot_id INTEGER, seq INTEGER, robot_time_us INTEGER, received_at_ms INTEGER,"
        " position_m REAL, velocity_m_s REAL, acceleration_m_s2 REAL, duty REAL, impedance_mv REAL, reference_m REAL,"
        " PRIMARY KEY (robot_id, seq)) WITHOUT ROWID")
    return database


def commit(database, frames):
    """frames: (robot's name, content of a frame of samples, received_at_ms)."""
    database.execute("BEGIN")
    ids = {}
    for name, content, received_at_ms in frames:
        if name not in ids:
            database.execute("INSERT OR IGNORE INTO robot (name) VALUES (?)", (name,))
            ids[name], = database.execute("SELECT robot_id FROM robot WHERE name = ?", (name,)).fetchone()
        first, time_us = struct.unpack_from("<IQ", content)
        period_us, robot_id = 10000, ids[name]
        database.executemany(INSERT, [(robot_id, first + i, time_us + period_us * i, received_at_ms, *channels)
                                      for i, channels in enumerate(struct.iter_unpack("<6f", content[12:]))])
    database.execute("COMMIT")


def now_ms():
    return time.time_ns() // 1_000_000
