"""Real pictures open; the sample frames that come with Kochab do too."""

import json
import warnings

import numpy as np
import pytest
from astropy.io import fits
from astropy.wcs import WCS

from kochab.core.attitude import roll_at, unit_vectors
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.frames import read_frame
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_frame
from resources.make_samples import SAMPLES


def test_every_real_frame_opens(shared_frames):
    opened = 0
    for path in sorted(shared_frames.iterdir()):
        if path.suffix != ".json":
            frame = read_frame(path)
            assert frame.pixels.std() > 0 or path.name in ("syn_black.png", "syn_white.png")
            opened += 1
    assert opened >= 60


def test_rows_of_fits_are_shown_as_the_truth_says(shared_frames):
    """The WCS another solver wrote, read in the frame's pixels, gives the truth's roll and parity."""
    name = "pan__solved.fits"
    true = json.loads((shared_frames / "truth.json").read_text())["frames"][name]
    frame = read_frame(shared_frames / name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        wcs = WCS(fits.getheader(shared_frames / name))
    x, y = (frame.width - 1) / 2, (frame.height - 1) / 2
    centre, up, right = (
        unit_vectors(*(float(a) for a in wcs.all_pix2world(x + dx, y + dy, 0))) for dx, dy in ((0, 0), (0, -1), (1, 0))
    )
    matrix = np.stack([right - centre, centre - up, centre])
    assert abs(roll_at(matrix, centre) - true["roll_deg"]) < 0.5
    assert (np.linalg.det(matrix) < 0) == true["mirrored"]


def test_sample_frames_open_and_are_small(repository):
    folder = repository / "resources" / "samples"
    told = json.loads((folder / "samples.json").read_text("utf-8"))
    assert len(told) >= 3
    for name, about in told.items():
        assert about["title"]
        frame = read_frame(folder / name)
        assert frame.width >= 640
        assert not frame.warnings
        assert (folder / name).stat().st_size < 1_000_000
    assert sum(p.stat().st_size for p in folder.iterdir()) < 3_000_000


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.file)
def test_sample_frames_solve_to_where_they_were_rendered(repository, sample):
    frame = read_frame(repository / "resources" / "samples" / sample.file)
    answer = run(solve_frame(frame, SolveOptions()))
    assert isinstance(answer, Solution)
    away = unit_vectors(*answer.ra_dec_deg) - unit_vectors(sample.ra_deg, sample.dec_deg)
    assert np.degrees(np.linalg.norm(away)) < sample.width_deg / sample.width  # a pixel
    assert abs(answer.roll_deg - sample.roll_deg) < 0.05
    assert answer.camera.mirrored == sample.mirrored
