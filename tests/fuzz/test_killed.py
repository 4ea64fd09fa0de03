"""Some runs that are ended at any moment, find a full disk or may not write (``make killed`` does 200)."""

import subprocess
import sys

import pytest

from tests.fuzz.runner import environment

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing limits the length of a file")

CARELESS = """
import sys
from pathlib import Path
from tests.fuzz import killed

def careless(folder):
    (folder / "a.json").write_text('{"a": "' + "x" * 300_000 + '"}')
    return 0

killed.night = lambda folder: None
killed.CASES = (killed.Case("careless", careless, ("a.json",)),)
sys.exit(killed.main())
"""


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-W", "ignore", *arguments], env=environment(), capture_output=True, text=True, timeout=280
    )


def test_what_is_written_is_old_or_new_and_what_cannot_be_is_told() -> None:
    cases = ("profile", "-f -update, gz", "report", "exports", "catalogue", "settings", "table", "patterns")
    done = run("-m", "tests.fuzz.killed", "--kills", "10", "--seed", "3", "--", *cases)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("told, told") == 6
    assert done.stdout.count("kept, kept") == 2


def test_a_writer_that_leaves_half_a_file_is_noticed() -> None:
    done = run("-c", CARELESS, "--kills", "6", "--seed", "3")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "killed (byte): a.json is neither as it was nor whole" in done.stdout
    assert "full disk" in done.stdout
