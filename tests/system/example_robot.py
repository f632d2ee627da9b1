"""Goes on in a Python that has Google's protobuf, for the tests of examples/robot.py, and lets them import it."""
import os
import pathlib
import sys

DEBIANS_PYTHON = "/usr/bin/python3"
try:
    import google.protobuf  # noqa: F401
except ModuleNotFoundError:  # another Python comes first here: python3-protobuf belongs to Debian's
    if os.path.realpath(sys.executable) == os.path.realpath(DEBIANS_PYTHON):
        sys.exit("no google.protobuf here; deploy/packages installs python3-protobuf")
    os.execv(DEBIANS_PYTHON, [DEBIANS_PYTHON, "-B", *sys.argv])

EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))
