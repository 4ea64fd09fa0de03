"""The tests that know of time, on other days and in other places: ``python -m tests.any_day``.

Debian's faketime tells every program that another day has come. Clocks that only count on stay
true, so that timeouts and sleeps last as long as ever.
"""

import argparse
import locale
import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from tests.patterns import REPOSITORY

# What reads the clock, the calendar, a file's age or the local time, or writes numbers in a table.
QUICK = [
    "tests/gear/cameras/test_arrivals.py",
    "tests/gear/cameras/test_folder.py",
    "tests/cli/test_output.py",
    "tests/cli/test_signals.py",
    "tests/core/test_earth.py",
    "tests/frames/test_hints.py",
    "tests/gear/mounts/test_epoch.py",
    "tests/gear/mounts/test_epoch_told.py",
    "tests/polar/test_horizon.py",
    "tests/sky/test_apparent.py",
    "tests/simulate/test_clock.py",
    "tests/simulate/test_mechanics_sky.py",
    "tests/simulate/test_responders_words.py",
    "tests/window/frame/test_exports.py",
    "tests/window/test_numerals.py",
    "tests/window/frame/test_readout.py",
    "tests/workflows/test_fresh_frame.py",
]
MORE = [
    "tests/gear/cameras",
    "tests/cli",
    "tests/frames",
    "tests/gear/mounts",
    "tests/polar",
    "tests/simulate",
    "tests/sky",
    "tests/workflows",
    "tests/window/test_damaged_settings.py",
    "tests/window/test_entry.py",
    "tests/window/frame/test_exports.py",
    "tests/text/test_angle_text.py",
    "tests/window/live/test_parts.py",
    "tests/window/mount/test_frames.py",
    "tests/window/mount/test_parts.py",
    "tests/window/test_numerals.py",
    "tests/window/polar/test_night.py",
    "tests/window/polar/test_room.py",
    "tests/window/polar/test_state.py",
    "tests/window/frame/test_readout.py",
    "tests/window/shell/test_welcome.py",
]
# The kernel dates files, and faketime does not reach it: a new file would be 400 days old.
WITH_FILE_TIMES = ["tests/gear/cameras/test_folder.py::test_a_file_without_a_date_was_taken_when_it_was_written"]
LATER_S = 400 * 86400


@dataclass(frozen=True)
class Situation:
    """When, an ISO time in UTC or None for 400 days from now, and where the tests are run."""

    name: str
    when_utc: str | None = None
    zone: str = "UTC"
    language: str = "C.UTF-8"

    def offset_s(self) -> int:
        if self.when_utc is None:
            return LATER_S
        there = datetime.fromisoformat(self.when_utc).replace(tzinfo=UTC)
        return round(there.timestamp() - time.time())

    def has_zone(self) -> bool:
        return Path("/usr/share/zoneinfo", self.zone).exists()

    def has_language(self) -> bool:
        before = locale.setlocale(locale.LC_ALL)
        try:
            locale.setlocale(locale.LC_ALL, self.language)
        except locale.Error:
            return False
        finally:
            locale.setlocale(locale.LC_ALL, before)
        return True


# It takes pytest some 15 s to collect the tests, so that midnight strikes while they run.
SITUATIONS = [
    Situation("400 days from now, in Chatham and in German", None, "Pacific/Chatham", "de_DE.UTF-8"),
    Situation("a leap day, in Kathmandu", "2028-02-29T12:00:00", "Asia/Kathmandu"),
    Situation("just before midnight UTC", "2027-06-30T23:59:35"),
    Situation("just before summer time", "2027-03-28T00:59:35", "Europe/Berlin", "de_DE.UTF-8"),
    Situation("just before winter time", "2027-10-31T00:59:35", "Europe/Berlin", "de_DE.UTF-8"),
]


def run(situation: Situation, tests: list[str], workers: str) -> int:
    """Run the tests there; pytest's exit code."""
    environment = os.environ | {
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        "NO_FAKE_STAT": "1",  # or Python would compile every source anew
        "LC_ALL": situation.language,
        "PYTHONPATH": os.pathsep.join(
            [str(Path(__file__).parent), str(REPOSITORY / "app"), str(REPOSITORY), os.environ.get("PYTHONPATH", "")]
        ).rstrip(os.pathsep),
        "QT_QPA_PLATFORM": os.environ.get("QT_QPA_PLATFORM", "offscreen"),
        "TZ": situation.zone,
    }
    command = [sys.executable, "-m", "pytest", "-q", "-n", workers]
    command += [f"--deselect={test}" for test in WITH_FILE_TIMES]
    return subprocess.run(
        ["faketime", "-f", f"{situation.offset_s():+d}", *command, *tests], cwd=REPOSITORY, env=environment, check=False
    ).returncode


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.any_day", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two situations, the quickest tests")
    parser.add_argument("-n", default="2", metavar="N", help="how many processes (2)")
    parser.add_argument("tests", nargs="*", help="files instead of those that know of time")
    asked = parser.parse_args()
    if shutil.which("faketime") is None:
        print("There are no tests on other days without faketime: apt-get install faketime")
        return 0 if asked.quick else 1
    failed = []
    for situation in SITUATIONS[: 2 if asked.quick else None]:
        if not situation.has_zone():
            print(f"Left out: {situation.name}; {situation.zone} is not installed (tzdata)")
            continue
        if not situation.has_language():
            print(f"Without the locale {situation.language}, which is not installed (locales):")
            situation = replace(situation, language="C.UTF-8")
        print(f"On another day: {situation.name}", flush=True)
        if run(situation, asked.tests or (QUICK if asked.quick else MORE), asked.n):
            failed.append(situation.name)
    print("Failed on: " + "; ".join(failed) if failed else "The tests hold on these days.")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
