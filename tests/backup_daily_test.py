"""Scripts of the Debian package, with a program in place of rheonaut: which daily copies stay, and what a purge says."""
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

SCRIPTS = pathlib.Path(__file__).resolve().parent.parent / "deploy/debian"
SCRIPT = SCRIPTS / "backup-daily"
AHEAD = [f"daily-203001{day:02}-000000.sqlite" for day in (1, 2, 3)]


class BackupDailyTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.data = pathlib.Path(folder.name)
        self.copies = self.data / "daily"
        self.copies.mkdir()
        (self.data / "station.sqlite").touch()
        self.checked = (f'{{\n  "valid": true,\n  "data": "{self.data}",\n'
                        '  "http": {"listen":"127.0.0.1:8080"},\n  "robots": {"data": "not this"}\n}')

    def names(self):
        return sorted(path.name for path in self.copies.iterdir())

    def back_up(self, program='for name; do :; done; echo new > "$name"', **settings):
        """`program` finds the name of the copy as its last argument; before it check-config names the data folder."""
        (self.data / "checked.json").write_text(self.checked)
        rheonaut = self.data / "rheonaut"
        rheonaut.write_text(f"""#!/bin/sh
echo "$@" >> '{self.data}/calls'
if [ "$1" = check-config ]; then cat '{self.data}/checked.json'; exit; fi
{program}
""")
        rheonaut.chmod(0o755)
        return subprocess.run([SCRIPT], env={**os.environ, "RHEONAUT_CONFIG": "lab.toml",
                                             "RHEONAUT_PROGRAM": str(rheonaut), **settings}, capture_output=True, text=True)

    def fill(self, *names):
        for name in names:
            (self.copies / name).write_text("older")

    def test_the_new_copy_stays_though_older_ones_have_later_names(self):
        self.fill(*AHEAD)
        self.assertEqual(0, self.back_up().returncode)
        new = set(self.names()) - set(AHEAD)
        self.assertEqual(1, len(new), self.names())
        self.assertEqual("new\n", (self.copies / new.pop()).read_text())
        self.assertEqual(3, len(self.names()))
        self.assertNotIn(AHEAD[0], self.names())

    def test_the_folder_is_that_of_the_configuration(self):
        self.assertEqual(0, self.back_up().returncode)
        asked, made = (self.data / "calls").read_text().splitlines()
        self.assertEqual("check-config --config lab.toml --json", asked)
        self.assertTrue(made.startswith(f"backup --data {self.data} --to {self.copies}/daily-2"), made)

    def test_before_the_first_start_there_is_nothing_to_copy(self):
        (self.data / "station.sqlite").unlink()
        done = self.back_up()
        self.assertEqual((0, [], ""), (done.returncode, self.names(), done.stderr))
        self.assertIn("no backup is made", done.stdout)

    def test_a_configuration_without_a_folder_is_an_error(self):
        self.checked = "{}"
        done = self.back_up()
        self.assertEqual((1, []), (done.returncode, self.names()))
        self.assertIn("names no data folder", done.stderr)

    def test_one_copy_is_the_new_one(self):
        self.fill(*AHEAD)
        self.assertEqual(0, self.back_up(RHEONAUT_BACKUP_COPIES="1").returncode)
        self.assertEqual(1, len(self.names()))
        self.assertNotIn(self.names()[0], AHEAD)

    def test_what_a_killed_run_left_is_removed_and_files_of_others_stay(self):
        others = ["monday.sqlite", "monday.sqlite.part", "daily-report.sqlite"]
        self.fill("daily-20260101-000000.sqlite.part", *others)
        self.assertEqual(0, self.back_up().returncode)
        self.assertEqual(set(others), {name for name in self.names() if not name.startswith("daily-2")})
        self.assertEqual(len(others) + 1, len(self.names()))

    def test_a_backup_that_fails_removes_no_older_copy(self):
        self.fill("daily-20250101-000000.sqlite", *AHEAD)
        self.assertNotEqual(0, self.back_up("exit 1").returncode)
        self.assertEqual(4, len(self.names()))


class PurgeTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        (self.root / "var/lib/misc").mkdir(parents=True)
        (self.root / "bin").mkdir()  # nothing of this machine but these is called
        for name in ("cat", "rm", "sed"):
            (self.root / "bin" / name).symlink_to(shutil.which(name))

    def said_by_a_purge(self, data):
        program = self.root / "rheonaut"
        program.write_text(f"""#!/bin/sh\necho '  "data": "{data}",'\n""")
        program.chmod(0o755)
        env = {"PATH": str(self.root / "bin"), "DPKG_ROOT": str(self.root), "RHEONAUT_PROGRAM": str(program)}
        return "".join(subprocess.run(["/bin/sh", SCRIPTS / script, step], env=env, check=True, capture_output=True,
                                      text=True).stderr
                       for script, step in (("prerm", "remove"), ("postrm", "remove"), ("postrm", "purge")))

    def test_another_data_folder_is_named_and_stays(self):
        data = self.root / "srv/lab"
        data.mkdir(parents=True)
        self.assertIn(f"the data folder {data} with its recordings stays", self.said_by_a_purge(data))
        self.assertTrue(data.exists())
        self.assertNotIn("stays", self.said_by_a_purge("/var/lib/rheonaut"))
        self.assertEqual([], list((self.root / "var/lib/misc").iterdir()))


if __name__ == "__main__":
    unittest.main()
