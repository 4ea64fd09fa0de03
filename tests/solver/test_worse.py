"""The doctor's reasons over real frames made worse: nine in ten name what was done."""

import numpy as np

from kochab.core.frame import Detections
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason
from kochab.frames import read_frame
from kochab.solver import SolveOptions
from kochab.solver.diagnosis import Evidence, diagnose
from kochab.solver.frame_quality import FrameLevels
from kochab.solver.pipeline import solve_frame

from .worse import WORSE, reasons

LINES = ("satellites", "lettered")
FRAMES = ("pan__solved.fits", "cedar__orion2.jpg", "pf__orion_bad.png", "pf__90ff3ee8_raw.png")


def test_nine_reasons_in_ten_are_what_was_done(shared_frames):
    """Frames that are solved all the same need no reason; of the others a table by what was done."""
    given = list(reasons(shared_frames, list(FRAMES), ways=tuple(way for way in WORSE if way not in LINES)))
    right = [answer.reason in WORSE[kind][1] for _, kind, answer in given]
    assert len(right) >= 20
    assert np.mean(right) >= 0.9, given


def test_a_globular_cluster_is_not_out_of_focus(frames_reach):
    """Its core and its brightest members are wide, each differently; defocused stars all have the same width."""
    frame = read_frame(frames_reach / "apd__tutorials_FITS-images_M13_blue_0001.fits")
    answer = run(solve_frame(frame, SolveOptions(timeout_s=None)))
    assert isinstance(answer, NoSolution)
    assert answer.reason is Reason.TOO_FEW_STARS


def test_letters_and_satellites_are_no_trails(shared_frames):
    given = list(reasons(shared_frames, list(FRAMES[::2]), ways=LINES[:1]))
    given += reasons(shared_frames, list(FRAMES[1::2]), ways=LINES[1:])
    assert len(given) == 4
    assert {answer.reason for _, _, answer in given} == {Reason.NO_PATTERN_AGREED}, given


def reason_of(count, glare_share):
    """The first finding for so many stars beside a bright patch."""
    rng = np.random.default_rng(1)
    xy = rng.uniform(0, 999, (count, 2))
    evidence = Evidence(Detections.from_list(xy, 1000, 1000))
    evidence.light = FrameLevels(0.1, 0.01, 50.0, glare_share, 1.1)
    return diagnose(evidence, None, {})


def test_a_bright_patch_hides_no_stars_where_many_are_found():
    """Clusters, nebulae and Polaris were "too few stars, perhaps the Moon" beside 211 detections."""
    assert reason_of(211, 0.05).reason is Reason.NO_PATTERN_AGREED
    told = reason_of(9, 0.05)
    assert told.reason is Reason.TOO_FEW_STARS
    assert "Only 9 stars" in told.advice
