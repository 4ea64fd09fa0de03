"""Guiding from the logs beside a night's frames: of logs written here as PHD2 writes them, with known scatter."""

import csv
import io
from datetime import UTC, datetime

import numpy as np
import pytest

from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.guiding import guiding_of
from kochab.workflows.night.page import night_page
from kochab.workflows.night.summary import night_of
from kochab.workflows.night.table import night_json
from tests.nights.guide_logs import evening, write_log

SCALE = 2.5
HEAD = """PHD2 version 2.6.13 [Linux], Log version 2.5. Log enabled at 2026-03-01 22:00:00

Guiding Begins at 2026-03-01 22:01:00
Pixel scale = {scale} arc-sec/px, Binning = 1, Focal length = 300 mm
Mount = Mount,  connected, guiding enabled, xAngle = 0.0, xRate = 5.0, yAngle = 90.0, yRate = 5.0, parity = +/+
RA = 5.00 hr, Dec = 20.0 deg, Hour angle = -1.00 hr, Pier side = East, Rotator pos = N/A, Alt = 50.0 deg, Az = 120.0 deg
Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration,RADirection,\
DECDuration,DECDirection,XStep,YStep,StarMass,SNR,ErrorCode
"""


def log(path, ra_px, dec_px, dither_after=None, jump_px=0.0, scale=SCALE):
    """A run of guiding, a frame each two seconds; the star settles for ten seconds after a dither."""
    lines = [HEAD.format(scale=scale).rstrip("\n")]
    for k, (ra, dec) in enumerate(zip(ra_px, dec_px, strict=True)):
        away = jump_px * np.exp(-(k - dither_after) / 1.5) if dither_after is not None and k > dither_after else 0.0
        lines.append(f'{k + 1},{2.0 * k:.3f},"Mount",0,0,{ra + away:.3f},{dec:.3f},0,0,0,,0,,,,900,30,0')
        if k == dither_after:
            lines.append("INFO: DITHER by 3.0, 0.0, new lock pos = 500.0, 400.0")
    path.write_text("\n".join([*lines, "Guiding Ends at 2026-03-01 22:40:00"]) + "\n")


def test_the_rms_is_that_of_the_scatter(tmp_path):
    """Of forty logs of white scatter, each axis within two sigma in about 95 of 100."""
    pulls = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        log(tmp_path / "PHD2_GuideLog.txt", rng.normal(0.1, 0.3, 300), rng.normal(0, 0.2, 300))
        (run,) = guiding_of([tmp_path])
        pulls += [(run.ra_arcsec.value - 0.3 * SCALE) / run.ra_arcsec.sigma]
        pulls += [(run.dec_arcsec.value - 0.2 * SCALE) / run.dec_arcsec.sigma]
    assert np.mean(np.abs(pulls) < 2.0) >= 0.88
    assert 0.6 < np.std(pulls) < 1.4
    assert (run.frames, run.dithers) == (300, 0)
    assert run.hours == pytest.approx(598 / 3600, abs=1e-4)
    assert run.total_arcsec.value == pytest.approx(np.hypot(run.ra_arcsec.value, run.dec_arcsec.value))


def test_backlash_in_dec_is_that_of_the_gear_that_the_log_was_made_with(tmp_path):
    """Ten logs of a simulated PHD2 whose mount has play; seeing 0.02 to 0.3 px, scales 1 to 6 arcsec a pixel."""
    pulls, with_play = [], 0
    for seed in range(28, 38):
        made = evening("dither", seed)
        write_log(made, tmp_path / "PHD2_GuideLog.txt")
        for run in guiding_of([tmp_path]):
            if run.backlash_arcsec:
                pulls.append((run.backlash_arcsec.value - made.backlash_arcsec) / run.backlash_arcsec.sigma)
                with_play += made.backlash_arcsec > 0.0 and run.backlash_arcsec.sigmas > 3.0
    assert len(pulls) >= 6
    assert with_play >= 3
    assert np.abs(pulls).max() < 3.0


def test_a_dither_and_its_settling_are_no_bad_guiding(tmp_path):
    rng = np.random.default_rng(3)
    log(tmp_path / "a.log", rng.normal(0, 0.3, 300), rng.normal(0, 0.2, 300), dither_after=150, jump_px=8.0)
    (run,) = guiding_of([tmp_path])
    assert run.dithers == 1
    assert run.frames < 300
    assert run.ra_arcsec.value == pytest.approx(0.3 * SCALE, rel=0.1)


@pytest.mark.parametrize("ended", ["complete", "failed"])
def test_the_star_settles_for_as_long_as_the_log_says(ended, tmp_path):
    """PHD2 2.6.14 says that it settles before a run begins too, and lost stars have rows without numbers.

    The order of the lines is that of public logs of 2026 (github.com/ste7e/PHD2Insight, samples).
    """
    rng = np.random.default_rng(5)
    change = "INFO: SETTLING STATE CHANGE, Settling {}"
    head, rows = HEAD.format(scale=SCALE).replace("\\\n", "").rstrip("\n").split("\n\n"), []
    for k in range(300):
        away = 6.0 if k < 20 or 150 <= k < 190 else 0.0
        if k == 150:
            rows += [change.format("started"), "INFO: DITHER by 3.0, 0.0, new lock pos = 500.0, 400.0"]
        if k == 100:
            rows.append('101,200.000,"DROP",,,,,,,,,,,,,0,0.00,5,"No star found"')
        else:
            ra, dec = rng.normal(away, 0.3), rng.normal(0, 0.2)
            rows.append(f'{k + 1},{2.0 * k:.3f},"Mount",0,0,{ra:.3f},{dec:.3f},0,0,0,,0,,,,900,30,0')
        if k in (19, 189):
            rows.append(change.format("complete" if k == 19 else ended))
    lines = [head[0], change.format("started"), "", *head[1].split("\n"), *rows, "Guiding Ends at 2026-03-01 22:40:00"]
    (tmp_path / "PHD2_GuideLog.txt").write_text("\r\n".join(lines) + "\r\n")
    (run,) = guiding_of([tmp_path])
    assert (run.frames, run.dithers) == (300 - 20 - 40 - 1, 1)
    assert run.ra_arcsec.value == pytest.approx(0.3 * SCALE, rel=0.1)


def test_logs_that_others_write_give_the_rms_of_their_rows(tmp_path):
    """The reference logs of the polar axis, their rows read here as CSV."""
    path = tmp_path / "PHD2_GuideLog_2026.txt"
    write_log(evening("plain", 5), path)
    lines = path.read_text().splitlines()
    (start,) = (k for k, line in enumerate(lines) if line.startswith("Frame,Time,mount"))
    rows = list(
        csv.DictReader(io.StringIO("\n".join(x for x in lines[start:] if x[:1].isdigit() or x.startswith("Frame"))))
    )
    scale = next(float(x.split("=")[1].split()[0]) for x in lines if x.startswith("Pixel scale"))
    rows = [row for row in rows if row["mount"].strip('"') == "Mount" and row["ErrorCode"] in ("0", "1")]
    (run,) = guiding_of([tmp_path])
    for name, found in (("RARawDistance", run.ra_arcsec), ("DECRawDistance", run.dec_arcsec)):
        assert found.value == pytest.approx(scale * np.std([float(row[name]) for row in rows], ddof=1), rel=1e-6)


def test_page_and_table_hold_the_guiding(tmp_path):
    rng = np.random.default_rng(4)
    log(tmp_path / "guide.txt", rng.normal(0, 0.3, 60), rng.normal(0, 0.2, 60))
    frames = [
        NightFrame(f"{k}.fits", datetime(2026, 3, 1, 22, k, tzinfo=UTC), 30.0, (900, 600), True) for k in range(3)
    ]
    night = night_of(frames, guiding=guiding_of([tmp_path]))
    assert "Guiding, RMS" in night_page(night, "lights")
    (row,) = night_json(night)["guiding"]
    assert row["begun"] == "2026-03-01T22:01:00", "local time, of no zone that is known"
    assert row["ra_arcsec"] == pytest.approx(0.75, abs=0.3)
    assert "Guiding, RMS" not in night_page(night_of(frames), "lights")


@pytest.mark.parametrize(
    "text", ["", "PHD2 version 2.6\n", "PHD2\nGuiding Begins at 2026-03-01 22:01:00\nnonsense\n", "x"]
)
def test_what_is_no_run_of_guiding_is_left_out(text, tmp_path):
    (tmp_path / "guide.txt").write_text(text)
    (tmp_path / "bytes.log").write_bytes(b"PHD2 \xff\x00\n" + bytes(range(256)))
    assert guiding_of([tmp_path, tmp_path / "nowhere"]) == ()


def test_a_run_without_a_scale_has_no_arcseconds(tmp_path):
    log(tmp_path / "guide.txt", np.zeros(60), np.zeros(60), scale=0.0)
    assert guiding_of([tmp_path]) == ()
