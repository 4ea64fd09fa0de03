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
        "tests/lab/bench/test_night.py::test_the_bench_of_nights_finds_what_is_planted_and_invents_nothing",
        "tests/cli/test_output.py::test_a_satellite_before_the_pleiades_is_listed_with_its_trail",
        "tests/sky/test_satellites.py::test_places_above_a_site_are_skyfields_to_a_metre*",
        "tests/sky/test_satellites.py::test_orbits_are_those_of_the_verification_of_sgp4*",
        "tests/sky/test_satellites.py::test_a_satellite_is_found_*",
        "tests/sky/test_satellites.py::test_the_same_elements_are_read_in_each_form",
        "tests/sky/test_satellites.py::test_satellites_of_one_name_are_all_read",
        "tests/sky/test_satellites.py::test_kept_files_are_read_the_newest_first_and_again_when_they_change",
        "tests/sky/test_satellites.py::test_a_bad_file_is_refused_in_one_sentence*",
        "tests/sky/test_satellites.py::test_the_trail_through_a_frame_is_in_the_sky_layer",
        "tests/sky/test_satellites.py::test_the_sigma_holds_over_eighteen_days_of_real_elements",
        "tests/sky/test_satellites.py::test_the_earths_shadow_begins_and_ends_when_skyfields_does",
        "tests/sky/test_satellites.py::test_old_elements_are_told_and_too_old_ones_leave_no_place",
        "tests/sky/test_satellites.py::test_an_instant_has_a_place_and_no_trail",
        "tests/window/frame/test_search.py::test_dropped_elements_are_kept_and_their_bodies_looked_for",
    ),
    "Wine 10's C runtime has no cexp, by which NumPy and SciPy take the exponential of a complex number": (
        "tests/solver/test_worse.py::test_nine_reasons_in_ten_are_what_was_done",
        "tests/workflows/test_night_periodic.py::test_astropys_periodogram_has_the_same_period",
    ),
    "Wine 10's NtQueryVirtualMemory tells no working set, by which psutil counts a process's own memory": (
        "tests/lab/bench/test_archive.py::test_a_small_archive_is_measured",
    ),
    "Wine 10's GetSystemTimeAsFileTime tells every instant apart, and Dask's distributed waits for five that are alike": (
        "tests/cli/test_archive.py::test_bad_arguments_get_one_sentence?arguments9-No Dask scheduler at?",
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
