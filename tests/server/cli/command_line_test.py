#!/usr/bin/env python3
"""Goes over every command of `rheonaut`: --help, completion, manual pages, exit status of mistakes, suggestions."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parents[3]
BIN = pathlib.Path(os.environ["RHEONAUT_BIN"])
# What prints no result for people: a program that runs on, scripts and pages, documents that are JSON or CSV already.
WITHOUT_JSON = {"serve", "completion", "man", "design show", "design export", "reference export"}
ROFF_REQUESTS = {"TH", "SH", "SS", "TP", "PP", "EX", "EE"}


def run(*words, program="rheonaut", **others):
    return subprocess.run([str(BIN / program), *words], capture_output=True, text=True, timeout=120,
                          stdin=subprocess.DEVNULL, **others)


def sections(help_text):
    """{heading: [(first word, the rest)]} of a --help."""
    found, heading = {}, None
    for line in help_text.splitlines():
        if re.fullmatch(r"\S.*:", line) and not line.startswith(("Usage:", "Example:")):
            heading = line[:-1]
            found[heading] = []
        elif heading and re.match(r"  \S", line):
            found[heading].append(line.strip())
        elif not line.startswith(" "):
            heading = None
    return found


class Command:
    """One command by its words, with what its --help says."""

    def __init__(self, words):
        self.words = words
        self.help = run(*words, "--help").stdout
        self.usage = re.search("(?m)^Usage: .*$", self.help).group()
        headings = sections(self.help)
        self.options, self.values, self.commands = [], {}, []
        for heading, lines in headings.items():
            for line in lines:
                if line.startswith("-"):
                    names = re.match(r"((?:--?[a-z0-9-]+(?:, )?)+)(?: (\S+))?", line)
                    for name in names.group(1).strip(", ").split(", "):
                        self.options.append(name)
                        if names.group(2) and "|" in names.group(2):
                            self.values[name] = names.group(2).split("|")
                elif heading != "Arguments" and " COMMAND" in self.usage:
                    self.commands.append(line.split()[0])


def every_command(words=()):
    command = Command(words)
    yield command
    for name in command.commands:
        yield from every_command((*words, name))


COMMANDS = list(every_command())


class CommandLineTest(unittest.TestCase):
    def test_help_is_grouped_has_examples_and_names_the_program(self):
        self.assertGreater(len(COMMANDS), 60)
        headings = sections(COMMANDS[0].help)
        for heading in ("Running a station", "Robots", "Recordings", "Models and controllers", "Experiments", "Accounts"):
            self.assertIn(heading, headings)
        self.assertNotIn("Commands", headings, "every command of the program has a group")
        for command in COMMANDS:
            with self.subTest(command=command.words):
                self.assertTrue(command.usage.startswith(" ".join(("Usage: rheonaut", *command.words))))
                if len(command.words) < 2:
                    self.assertRegex(command.help, r"(?m)^Example: rheonaut")
                for line in command.help.splitlines():
                    known = line.startswith(("Example: ", "Usage: ")) or '{"kp"' in line
                    self.assertTrue(known or len(line) <= 80, line)

    def test_every_command_answers_in_json(self):
        without = {" ".join(command.words) for command in COMMANDS
                   if not command.commands and "--json" not in command.options}
        self.assertEqual(without, WITHOUT_JSON)
        with tempfile.TemporaryDirectory() as folder:
            copy, restored = f"{folder}/copy.sqlite", f"{folder}/restored"
            for words in (["token", "create", "a"], ["token", "revoke", "a"], ["robot", "enrol", "r"],
                          ["robot", "retire", "r"], ["robot", "list"], ["user", "list"], ["bode"], ["profile"],
                          ["check-config"], ["certificate"], ["backup", "--to", copy],
                          ["restore", "--from", copy, "--data", restored]):
                data = [] if words[0] in ("bode", "profile") or "--data" in words else ["--data", folder]
                done = run(*words, "--json", *data)
                self.assertEqual((done.returncode, done.stderr), (0, ""), words)
                said = json.loads(done.stdout)
                if words[0] == "backup":
                    self.assertEqual(said, {"file": copy, "size_bytes": os.path.getsize(copy), "verified": True})
            # An error is the same as without --json: a line on standard error, and nothing on standard output.
            for words in (["certificate"], ["backup", "--to", copy], ["restore", "--from", copy, "--data", restored],
                          ["export", "--run", "1", "--format", "csv", "--to", f"{folder}/run.csv"],
                          ["reference", "show", "--run", "1"], ["reference", "remove", "--run", "1", "--reason", "a"],
                          ["report", "1", "--to", f"{folder}/run.html"], ["capsule", "1", "--to", f"{folder}/run.eln"],
                          ["check-config", "--config", f"{folder}/none.toml"]):
                data = [] if "--data" in words else ["--data", folder]
                done, plain = run(*words, "--json", *data), run(*words, *data)
                self.assertEqual((done.returncode, done.stdout, done.stderr), (1, "", plain.stderr), words)
                self.assertRegex(done.stderr, r"^rheonaut: [^\n]+\n$")

    def test_a_mistake_is_exit_status_2_with_a_suggestion(self):
        for command in COMMANDS:
            with self.subTest(command=command.words):
                done = run(*command.words, "--nonsense")
                self.assertEqual((done.returncode, done.stdout), (2, ""), done)
                self.assertRegex(done.stderr, r"^rheonaut: [^\n]*--nonsense[^\n]*see rheonaut[^\n]* --help\n$")
        for words, suggestion in ((["srve"], "serve"), (["robot", "paramters"], "parameters"),
                                  (["identify", "--cvs", "x"], "--csv"), (["man", "stpo"], "stop"),
                                  (["tune", "--phase-margn", "3"], "--phase-margin-deg"),
                                  (["export", "--run", "1", "--format", "matt", "--to", "x"], "mat"),
                                  (["completion", "bsh"], "bash")):
            done = run(*words)
            self.assertEqual(done.returncode, 2)
            self.assertIn(f", did you mean {suggestion}?", done.stderr)
        self.assertNotIn("did you mean", run("xyzzy").stderr)
        self.assertEqual(run().returncode, 2)
        self.assertEqual(run("nonsense", program="rheonaut-sim").returncode, 2)

    def test_a_name_or_value_that_there_is_not_is_a_mistake_too(self):
        for program, words, text in (
                ("rheonaut", ["profile", "figure_77"], "; did you mean figure_7?"),
                ("rheonaut-sim", ["play", "figure_77"], "; did you mean figure_7?"),
                ("rheonaut-sim", ["scenarios", "--show", "bad_dya"], "; did you mean bad_day?"),
                ("rheonaut-sim", ["--station", "127.0.0.1"], "'127.0.0.1' is not ADDR:PORT"),
                ("rheonaut-sim", ["--station", "127.0.0.1:1", "--fluid", "watr"], "is 'watr', did you mean water?"),
                ("rheonaut-sim", ["--station", "127.0.0.1:1", "--data", "x"], "--data"),
                ("rheonaut-sim", [], "--station or --data is required")):
            with self.subTest(words=words):
                done = run(*words, program=program)
                self.assertEqual((done.returncode, done.stdout), (2, ""), done)
                self.assertRegex(done.stderr, rf"^{program}: [^\n]*{re.escape(text)}[^\n]*\n$")

    def test_every_program_says_its_version_and_so_do_commands(self):
        version = run("--version").stdout
        self.assertRegex(version, r"^\d+\.\d+\.\d+\n$")
        for program in ("rheonaut-sim", "rheonaut-export"):
            self.assertEqual(run("--version", program=program).stdout, version)
        for command in COMMANDS[::8]:  # it is one option, which each inherits
            done = run(*command.words, "--version")
            self.assertEqual((done.returncode, done.stdout), (0, version), command.words)

    def test_a_folder_without_a_station_is_named(self):
        with tempfile.TemporaryDirectory() as folder:
            text = f"rheonaut: there is no folder '{folder}/none'; --data names that of a station\n"
            for words in (["login-link"], ["fluid", "list"], ["watch"]):
                done = run(*words, "--data", f"{folder}/none")
                self.assertEqual((done.returncode, done.stdout, done.stderr), (1, "", text))
            done = run("--data", folder, program="rheonaut-sim")
            self.assertEqual(done.returncode, 1)
            self.assertIn(f"no station runs in '{folder}'", done.stderr)

    def test_a_reader_who_has_read_enough_is_no_fault_and_a_full_disk_is(self):
        for words in (["--help"], ["profile"], ["man"]):
            with self.subTest(words=words):
                reader, writer = os.pipe()
                os.close(reader)
                with os.fdopen(writer, "w") as pipe:
                    done = subprocess.run([str(BIN / "rheonaut"), *words], stdout=pipe, stderr=subprocess.PIPE, text=True,
                                          timeout=120)
                self.assertEqual((done.returncode, done.stderr), (0, ""))
                with open("/dev/full", "w", encoding="utf-8") as full:
                    done = subprocess.run([str(BIN / "rheonaut"), *words], stdout=full, stderr=subprocess.PIPE, text=True,
                                          timeout=120)
                self.assertEqual(done.returncode, 1)
                self.assertIn("is the disk full?", done.stderr)

    def test_exit_statuses_of_the_manual_are_those_of_the_documents(self):
        page = run("man").stdout
        manual = re.findall(r"\.TP\n\\fB(\d)\\fR\n(.*)\n", page[page.index(".SH EXIT STATUS"):])
        document = re.findall(r"(?m)^\| (\d) \| (.*) \|$", (ROOT / "docs/commands.md").read_text())
        self.assertEqual([code for code, _ in manual], list("012345"))
        said = [(code, meaning.replace("\\-", "-").replace("\\(aq", "'")) for code, meaning in manual]
        self.assertEqual(said, [(code, meaning.replace("`", "")) for code, meaning in document])

    def check_page(self, page, name):
        self.assertTrue(page.startswith(f'.TH {name.upper()} 1 "" '.replace("-", "\\-")), page[:80])
        for line in page.splitlines():
            if line.startswith("."):
                self.assertIn(line[1:].split()[0], ROFF_REQUESTS, line)
            self.assertFalse(line.startswith("'"), line)
            self.assertTrue(line.isascii(), line)
            self.assertRegex(re.sub(r"\\(e|-|&|f[BIR]|\((aq|ga|ha|ti)|\[u[0-9A-F]{4,6}\])", "", line), r"^[^\\]*$")
        if shutil.which("man") and shutil.which("groff"):
            done = subprocess.run(["man", "-l", "--warnings", "-Tutf8", "-"], input=page, capture_output=True, text=True,
                                  env=dict(os.environ, MANWIDTH="80", LC_ALL="C.UTF-8"), timeout=60)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            self.assertIn("EXIT STATUS", re.sub(".\x08", "", done.stdout))

    def test_manual_pages_have_every_command_and_option(self):
        names = run("man", "--list").stdout.split()
        self.assertEqual(sorted(names), sorted(["rheonaut", *(f"rheonaut-{command.words[0]}" for command in COMMANDS
                                                              if len(command.words) == 1)]))
        for name in names:
            with self.subTest(page=name):
                page = run("man", *([name] if name != "rheonaut" else [])).stdout
                self.check_page(page, name)
                own = name.partition("-")[2]
                for command in COMMANDS:
                    if command.words[:1] == ((own,) if own else ()):
                        for option in command.options:
                            self.assertIn(rf"\fB{option}\fR".replace("-", "\\-"), page, command.words)
        self.assertEqual(run("man", "stop").stdout, run("man", "rheonaut-stop").stdout)
        self.check_page(run("--man", program="rheonaut-sim").stdout, "rheonaut-sim")

    def bash_offers(self, folder, *words, program="rheonaut"):
        script = (f"source {folder}/{program}; COMP_WORDS=({program} \"$@\"); COMP_CWORD=$#; "
                  f"_{program.replace('-', '_')}; printf '%s\\n' \"${{COMPREPLY[@]}}\"")
        done = subprocess.run(["bash", "--norc", "-c", script, "bash", *words], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.stderr, "")
        return done.stdout.split()

    def test_bash_completes_every_command_option_and_word(self):
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "rheonaut").write_text(run("completion", "bash").stdout)
            for command in COMMANDS:
                with self.subTest(command=command.words):
                    self.assertEqual(sorted(self.bash_offers(folder, *command.words, "-")), sorted(command.options))
                    if command.commands:
                        self.assertEqual(sorted(self.bash_offers(folder, *command.words, "")), sorted(command.commands))
                    for option, words in command.values.items():
                        self.assertEqual(self.bash_offers(folder, *command.words, option, ""), words)
            self.assertEqual(self.bash_offers(folder, "sto"), ["stop"])
            self.assertEqual(self.bash_offers(folder, "robot", "--data", "x", "par"), ["parameters"])
            self.assertEqual(self.bash_offers(folder, "export", "--data", ""), [], "files, by bash itself")
            self.assertEqual(self.bash_offers(folder, "completion", "z"), ["zsh"])
            pathlib.Path(folder, "rheonaut-sim").write_text(run("--completion", "bash", program="rheonaut-sim").stdout)
            self.assertIn("--scenario", self.bash_offers(folder, "--sc", program="rheonaut-sim"))

    def offered_by(self, shell, script, lines):
        """What a shell offers for each of these command lines (words, and the beginning of one): a set for each."""
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "completion").write_text(run("completion", shell).stdout)
            pathlib.Path(folder, "ask").write_text(script(f"{folder}/completion", lines))
            quiet = "--no-config" if shell == "fish" else "--no-rcs"
            own = {"PATH": os.environ["PATH"], "HOME": folder, "LC_ALL": "C.UTF-8"}
            done = subprocess.run([shell, quiet, f"{folder}/ask"], capture_output=True, text=True, timeout=200, env=own)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return [set(part.split()) for part in done.stdout.split("==\n")[1:]]

    def check_offers(self, shell, script):
        asked = [(command, end) for command in COMMANDS for end in ("-", "") if end or command.commands]
        values = [(command, option, words) for command in COMMANDS for option, words in command.values.items()]
        lines = [(*command.words, end) for command, end in asked]
        lines += [(*command.words, option, "") for command, option, _ in values]
        offers = self.offered_by(shell, script, lines)
        self.assertEqual(len(offers), len(lines))
        for (command, end), offered in zip(asked, offers):
            with self.subTest(shell=shell, command=command.words, end=end):
                self.assertEqual(offered, set(command.options if end else command.commands))
        for (command, option, words), offered in zip(values, offers[len(asked):]):
            with self.subTest(shell=shell, command=command.words, option=option):
                self.assertEqual(offered, set(words))

    def test_fish_completes_every_command_option_and_word(self):
        def script(completion, lines):
            asks = (f"echo ==\ncomplete -C 'rheonaut {' '.join(line)}' | string replace -r '\\t.*' ''" for line in lines)
            return f"source {completion}\n" + "\n".join(asks)
        self.check_offers("fish", script)

    def test_zsh_completes_every_command_option_and_word(self):
        # Functions in place of zsh's own completion, which needs a terminal: they print what they are given.
        stubs = ("compdef() { }\n_files() { print -- FILES }\ncompadd() { print -l -- ${@:#-*} }\n"
                 "_describe() { local name=${@[-1]}; print -l -- ${${(P)name}%%:*} }\n")

        def script(completion, lines):
            asks = (f"print -- '=='\nwords=(rheonaut {' '.join(line[:-1])} '{line[-1]}')\n"
                    f"CURRENT={len(line) + 1}; _rheonaut" for line in lines)
            return f"{stubs}source {completion}\n" + "\n".join(asks)
        self.check_offers("zsh", script)


if __name__ == "__main__":
    unittest.main()
