"""What must hold of a station's database when the station has stopped, asked with plain SQL."""
import contextlib
import json
import sqlite3


def intervals_by_boot(database):
    """{boot_id: [(first_seq, last_seq, what)]}, ascending; what is "stored" or the cause of a gap."""
    found = {boot: [] for boot, in database.execute("SELECT boot_id FROM boot")}
    for boot, first, last in database.execute("SELECT boot_id, first_seq, last_seq FROM segment JOIN boot USING (boot_key)"):
        found[boot].append((first, last, "stored"))
    for boot, first, last, cause in database.execute(
            "SELECT boot_id, first_seq, last_seq, cause FROM gap JOIN boot USING (boot_key)"):
        found[boot].append((first, last, cause))
    return {boot: sorted(parts) for boot, parts in found.items()}


def audit(path):
    """(faults, samples stored, samples lost): every number of every boot is stored once, or lost once with a cause."""
    faults, stored, lost = [], 0, 0
    with contextlib.closing(sqlite3.connect(path)) as database:
        integrity = database.execute("PRAGMA integrity_check").fetchone()[0]
        if integrity != "ok":
            faults.append(f"integrity_check: {integrity}")
        faults += [f"foreign key: {row}" for row in database.execute("PRAGMA foreign_key_check")]
        for boot, parts in intervals_by_boot(database).items():
            expected = 0
            for first, last, what in parts:
                if first != expected:
                    kind = "a hole" if first > expected else "twice"
                    faults.append(f"boot {boot}: {kind} between {expected} and {first} ({what})")
                expected = max(expected, last + 1)
                if what == "stored":
                    stored += last - first + 1
                else:
                    lost += last - first + 1
        rows, = database.execute("SELECT count(*) FROM sample").fetchone()
        if rows != stored:
            faults.append(f"{rows} rows for {stored} samples in segments")
        without, = database.execute("SELECT count(*) FROM segment WHERE (SELECT count(*) FROM sample"
                                    " WHERE row BETWEEN first_row AND last_row) <> last_seq - first_seq + 1").fetchone()
        if without:
            faults.append(f"{without} segments without all of their rows")
    return faults, stored, lost


def signed(id_of_64_bits):
    """As SQLite has it."""
    return id_of_64_bits - (1 << 64) if id_of_64_bits >> 63 else id_of_64_bits


def outside_ledger(path, ledger):
    """What is noted as overrun though its robot's ring had not given it up, or is missing though it was acknowledged; the
    ledger is of `rheonaut-sim replay --ledger`. [] if nothing."""
    found = []
    with contextlib.closing(sqlite3.connect(path)) as database:
        boots = intervals_by_boot(database)
    with open(ledger) as lines:
        for line in lines:
            robot = json.loads(line)
            for first, last, what in boots.get(signed(robot["boot_id"]), []):
                given_up = any(begin <= first and last < end for begin, end in robot["overwritten"])
                if what != "stored" and not given_up:
                    found.append(f"{robot['robot_id']}: {first} to {last} {what}, acknowledged below "
                                 f"{robot['acknowledged_next_seq']}, overwritten {robot['overwritten']}")
    return found
