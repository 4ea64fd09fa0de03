"""Nights are kept by equipment and site, compared with the last of these, and never a reason to fail."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.workflows.night.earlier import (
    NightRecord,
    against_earlier,
    compared_with_earlier,
    keep_night,
    kept_nights,
    record_of,
)
from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.summary import night_of


def record(day, fwhm, equipment="camera 900x600", scale=2.0, site=(48.0, 11.0)):
    values = {"fwhm_arcsec": (fwhm, 0.05), "elongation": (1.1, 0.01)}
    return NightRecord(f"2026-01-{day:02d}T20:00:00+00:00", equipment, scale, site, values)


def test_a_night_stands_among_the_last_of_the_same_equipment_and_site(tmp_path):
    path = tmp_path / "state" / "nights.jsonl"
    for day, fwhm in enumerate((2.8, 3.0, 2.9, 3.1, 2.95), 1):
        keep_night(record(day, fwhm), path)
    for other in (
        record(6, 9.0, "another 900x600"),
        record(7, 9.0, scale=4.0),
        record(8, 9.0, site=(20.0, 11.0)),
        record(9, 9.0, site=None),
    ):
        keep_night(other, path)
    kept = kept_nights(path)
    assert len(kept) == 9
    found = {one.name: one for one in against_earlier(record(20, 4.5), kept)}
    fwhm = found["fwhm_arcsec"]
    assert (fwhm.nights, fwhm.usual.value) == (5, 2.95)
    assert 0.05 < fwhm.usual.sigma < 0.25
    assert fwhm.unusual
    assert not found["elongation"].unusual
    assert not any(one.unusual for one in against_earlier(record(20, 3.0), kept))
    assert against_earlier(record(20, 3.0), kept[:2]) == []


def test_the_same_night_again_takes_its_own_place_and_spoilt_lines_are_left_out(tmp_path):
    path = tmp_path / "nights.jsonl"
    keep_night(record(1, 3.0), path)
    keep_night(record(1, 4.0), path)
    assert [one.values["fwhm_arcsec"][0] for one in kept_nights(path)] == [4.0]
    with path.open("a") as file:
        file.write(
            'not json\n{"began": 3}\n[]\n{"began":"x","equipment":"y","scale_arcsec_px":0,"site":null,"values":{}}\n'
        )
    assert len(kept_nights(path)) == 1
    path.write_bytes(b"\xff\x00\xfe" * 50)
    assert kept_nights(path) == []
    keep_night(record(2, 3.0), tmp_path)  # a folder, not a file: nothing is kept, nothing fails


START = datetime(2026, 1, 12, 20, tzinfo=UTC)


def frames_of_a_night(start=START):
    rng = np.random.default_rng(1)
    return [
        NightFrame(f"{k}", start + timedelta(minutes=4 * k), 60.0, (900, 600), True, ra_deg=40 + rng.normal(0, 1e-4),
                   dec_deg=30 + rng.normal(0, 1e-4), width_deg=1.0, scale_arcsec_px=2.0, camera="cam", site=Site(48.1, 11.2))
        for k in range(12)
    ]  # fmt: skip


def test_what_is_kept_of_a_night_is_its_equipment_and_numbers():
    frames = frames_of_a_night()
    found = record_of(night_of(frames))
    assert (found.equipment, found.scale_arcsec_px, found.site) == ("cam 900x600", 2.0, (48.1, 11.2))
    assert found.began == START.isoformat()
    assert found.values["ra_arcsec_h"][1] > 0
    assert record_of(night_of([replace(one, time_utc=None) for one in frames])) is None
    assert found.alike(replace(found, scale_arcsec_px=2.02, site=(48.15, 11.2)))
    assert not found.alike(replace(found, site=(48.3, 11.2)))


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))


def test_a_night_that_was_stopped_is_compared_and_not_kept():
    """Its numbers are of a part of it alone."""
    for day in range(4):
        compared_with_earlier(night_of(frames_of_a_night(START - timedelta(days=day + 1))))
    assert len(kept_nights()) == 4
    tonight = night_of(frames_of_a_night())
    assert compared_with_earlier(tonight, whole=False)
    assert len(kept_nights()) == 4
    assert compared_with_earlier(tonight)
    assert len(kept_nights()) == 5
    assert compared_with_earlier(night_of([])) == []
