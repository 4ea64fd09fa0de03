"""What Wine 10 lacks: these tests skip under it, by name and with the reason; on a Windows itself they run.

`KOCHAB_WINE=all` in the environment tries them all the same, to see what a newer Wine has learnt.
"""

import os
from collections.abc import Iterable
from fnmatch import fnmatch

import pytest

LACKING: dict[str, tuple[str, ...]] = {
    "Wine 10 takes a job's limits and keeps none: QueryInformationJobObject tells of none afterwards": (
        "tests/frames/test_sandbox.py::test_a_decoder_may_not_fill_the_memory",
        "tests/frames/test_sandbox.py::test_on_windows_a_decoder_starts_no_program",
    ),
    "Wine 10's C runtime reads no mean motion for sgp4 (no_kozai is 0), whose compiled part asks sscanf": (
        "tests/cli/test_output.py::test_a_satellite_before_the_pleiades_is_listed_with_its_trail",
    ),
}
"""Reason -> tests, as patterns of their names."""


def skip_what_wine_lacks(items: Iterable[pytest.Item]) -> None:
    """Mark the tests of `LACKING`, where these are collected under Wine."""
    if os.environ.get("KOCHAB_WINE", "all") == "all":
        return
    for item in items:
        for reason, patterns in LACKING.items():
            if any(fnmatch(item.nodeid, pattern) for pattern in patterns):
                item.add_marker(pytest.mark.skip(reason=f"Wine: {reason}"))
