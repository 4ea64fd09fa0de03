"""The pointing model of a night, from frames whose headers say where the mount was, on mounts with known terms.

The mounts of `faulty_mounts` are made of axes and rotations with ERFA; the practice rig is another's, gears and all.
"""

from dataclasses import replace
from datetime import timedelta
from html import unescape

import erfa
import numpy as np
import pytest

from kochab.cli.night import text_of
from kochab.core.frame import Site
from kochab.core.mount import Epoch, PierSide
from kochab.gear.mounts.coordinates import from_mount_epoch, to_mount_epoch
from kochab.pointing.disagreement import investigate
from kochab.pointing.pointing_model import fit_model
from kochab.simulate.mechanics.geometry import Build, MountConfig
from kochab.simulate.rig import PracticeRig, RigConfig
from kochab.sky.horizon import sidereal_deg
from kochab.workflows.night.frame import NightFrame, _epoch, _pier_side
from kochab.workflows.night.measure import Measure
from kochab.workflows.night.page import night_page
from kochab.workflows.night.pointing import pointing_of
from kochab.workflows.night.summary import night_of
from kochab.workflows.night.table import night_json, night_json_text
from kochab.workflows.pointing_model import load_sightings
from tests.pointing.faulty_mounts import sightings
from tests.pointing.test_pointing_model import bad_mount


def frames_of(seen, epoch):
    """Sightings as frames whose headers give the mount's position in that equinox."""
    frames = []
    for k, one in enumerate(seen):
        icrs = from_mount_epoch(one.reported, one.time_utc)
        reported = icrs if epoch is Epoch.J2000 else to_mount_epoch(*icrs, Epoch.DATE, one.time_utc)
        frames.append(
            NightFrame(
                f"light_{k}.fits",
                time_utc=one.time_utc,
                solved=True,
                ra_deg=one.sky_deg[0],
                dec_deg=one.sky_deg[1],
                roll_deg=12.0 if k % 2 else 193.0,
                site=one.site,
                reported_deg=tuple(reported),
                pier_side=one.pier_side,
            )
        )
    return frames


@pytest.fixture(scope="module")
def night():
    mount, rng = bad_mount(2)
    return mount, sightings(mount, 10, rng, sides=True)


@pytest.mark.parametrize("epoch", list(Epoch))
def test_the_model_is_the_mounts_by_headers_of_either_equinox(night, epoch) -> None:
    mount, seen = night
    found = pointing_of(frames_of(seen, epoch))
    assert found.model is not None
    assert found.model.epoch is epoch
    assert found.model.helps
    leans = np.degrees(mount.base.as_rotvec()[:2])
    pulls = (np.array(found.model.terms_deg[2:4]) - leans) / np.array(found.model.sigmas_deg[2:4])
    assert np.abs(pulls).max() < 4.0
    assert found.model.terms_deg[4] == pytest.approx(20.0 / 60.0, abs=4.0 * found.model.sigmas_deg[4])


def test_a_nights_json_aims_gotos_by_the_same_model(night, tmp_path) -> None:
    one = night_of(frames_of(night[1], Epoch.DATE))
    path = tmp_path / "field-night.json"
    path.write_text(night_json_text(one))
    again = fit_model(load_sightings(path))
    assert again.terms_deg == pytest.approx(one.pointing.model.terms_deg, abs=1e-9)
    assert again.epoch is Epoch.DATE
    page = unescape(night_page(one, "field"))
    assert "<th>Pointing model</th>" in page
    assert all(f"<td>{value}</td>" in page.replace("\u00a0", " ") for _, value in one.pointing.model.rows())
    assert one.pointing.model.worth() in page
    assert "kochab mount goto TARGET --model NIGHT.json" in page
    assert "\n  pointing " in text_of(one, "page.html")


def test_frames_of_one_place_are_one_sighting(night) -> None:
    """A night has fifty frames of a place: they would weigh it fifty times."""
    frames = frames_of(night[1], Epoch.J2000)
    many = [
        replace(one, file=f"{k}.fits", time_utc=one.time_utc + timedelta(seconds=40.0 * k))
        for one in frames
        for k in range(5)
    ]
    assert len(pointing_of(many).sightings) == len(pointing_of(frames).sightings) == len(frames)


def why(frames):
    found = pointing_of(frames)
    assert found.model is None
    assert found.useful_sightings == ()
    assert night_json(night_of(frames))["pointing_model"] is None
    (line,) = found.lines()
    assert line.startswith("Pointing model and tube flexure unknown: ")
    assert night_json(night_of(frames))["tube_flexure_unknown"].startswith("Tube flexure unknown: ")
    return line


def test_what_keeps_a_night_from_a_model_is_named(night) -> None:
    frames = frames_of(night[1], Epoch.J2000)
    assert "no header has" in why([replace(one, reported_deg=None) for one in frames])
    assert "no header has" in why([replace(one, site=None) for one in frames])
    assert "no header has" in why([replace(one, solved=False) for one in frames])
    assert "repeat the solution" in why([replace(one, reported_deg=(one.ra_deg, one.dec_deg)) for one in frames])
    assert "another place" in why([replace(one, reported_deg=(one.ra_deg, one.dec_deg - 8.0)) for one in frames])
    assert "six places" in why(frames[:5])
    turned = [replace(one, roll_deg=40.0 * k) for k, one in enumerate(frames)]
    assert "camera turned" in why(turned)


def test_a_mount_that_was_synced_at_each_place_gets_no_model_for_its_gotos() -> None:
    """Only noise is left, which no error of an axis explains."""
    for seed in range(12):
        mount, rng = bad_mount(seed)
        frames = [
            replace(one, reported_deg=(one.ra_deg + east / 60.0, one.dec_deg + north / 60.0))
            for one, (east, north) in zip(
                frames_of(sightings(mount, 8, rng, sides=True), Epoch.J2000), rng.normal(0.0, 3.0, (8, 2)), strict=True
            )
        ]
        assert pointing_of(frames).useful_sightings == ()


SITES = [Site(47.0, 8.0, 450.0), Site(-33.0, 151.0, 60.0)]
HOURS_AND_DECS = [(-50, 10), (15, 20), (-10, 65), (35, 50), (-30, 45), (55, 5), (-60, 60), (40, -10)]


def rig_frames(site, build, every_s=60.0, epoch=Epoch.DATE, places=HOURS_AND_DECS):
    """Frames of the practice rig at some places; its axis stands 25 arcmin too high and 40 off in azimuth."""
    mount = MountConfig(misalignment_arcmin=(25.0, 40.0), build=build)
    north = np.sign(site.latitude_deg)
    rig = PracticeRig(RigConfig(seed=4, site=site, mount=mount, start_deg=(-20.0, north * 30.0)))
    for hour, dec in places:
        assert not rig.mount.goto((rig.mount.sidereal_deg() - hour) % 360.0, north * dec)
        rig.wait_until_still(1.0)
        rig.clock.sleep(every_s)
        truth = rig.truth()
        ra_deg, dec_deg = truth.ra_dec_deg
        yield NightFrame(
            "",
            time_utc=truth.time_utc,
            solved=True,
            ra_deg=ra_deg,
            dec_deg=dec_deg,
            roll_deg=truth.attitude.roll_deg,
            site=site,
            reported_deg=rig.mount.believed_deg(),
            pier_side=rig.mount.pier_side,
            epoch=epoch,
        )


@pytest.mark.parametrize("site", SITES)
@pytest.mark.parametrize(("every_s", "epoch"), [(1800.0, None), (60.0, Epoch.DATE)])
def test_the_practice_rigs_polar_axis_and_cone_are_found_from_its_own_word(site, every_s, epoch) -> None:
    """Its computer counts steps, and its tube leans by 12 arcmin."""
    found = pointing_of(list(rig_frames(site, Build(cone_deg=0.2, camera_roll_deg=20.0), every_s, epoch)))
    assert found.model is not None, found.why
    assert found.model.helps
    terms = dict(zip(("RA", "Dec", "west", "high", "cone"), 60.0 * np.array(found.model.terms_deg), strict=True))
    high = np.sign(site.latitude_deg) * terms["high"]
    assert high == pytest.approx(26.0, abs=2.0), "the rig's pole is the refracted one, 1 arcmin higher"
    assert abs(terms["west"]) == pytest.approx(40.0 * np.cos(np.radians(site.latitude_deg)), abs=2.0)
    assert abs(terms["cone"]) == pytest.approx(12.0, abs=1.0)
    assert found.model.after_arcsec < 90.0 < 1200.0 < found.model.before_arcsec


def high_places(site, count, rng):
    """Hour angles and declinations, degrees, north of the equator, more than 20 degrees up."""
    found = []
    while len(found) < count:
        hour, dec = rng.uniform(-65.0, 65.0), rng.uniform(-15.0, 80.0)
        _, altitude = erfa.hd2ae(*np.radians([hour, dec, abs(site.latitude_deg)]))
        if np.degrees(altitude) > 20.0:
            found.append((hour, dec))
    return found


def test_the_practice_rigs_flexure_is_found_from_its_own_word() -> None:
    """Its sky is refracted, which its computer knows nothing of; its axes are not quite square."""
    rng, pulls, sigmas = np.random.default_rng(5), [], []
    for k in range(8):
        sags = float(rng.uniform(0.0, 120.0))
        site = SITES[k % 2]
        build = Build(cone_deg=rng.normal(0.0, 0.1), square_deg=rng.normal(0.0, 0.03), flexure_arcsec=sags)
        frames = list(rig_frames(site, build, places=high_places(site, 9 + k, rng)))
        found = pointing_of(frames).flexure
        assert found is not None
        pulls.append((found.value - sags) / found.sigma)
        sigmas.append(found.sigma)
    assert np.sqrt(np.mean(np.square(pulls))) < 1.5
    assert np.abs(pulls).max() < 3.0
    assert np.median(sigmas) < 10.0
    night = night_of(frames)
    words = f"Tube flexure: {found.text('+')}″ from zenith to horizon."
    assert words in unescape(night_page(night, "field")).replace("\u00a0", " ")
    assert f"pointing {words}" in text_of(night, "page.html")
    told = night_json(night)
    assert (told["tube_flexure_arcsec"], told["tube_flexure_arcsec_sigma"]) == (found.value, found.sigma)
    assert told["tube_flexure_unknown"] is None


def test_few_places_tell_no_flexure(night) -> None:
    found = pointing_of(frames_of(night[1], Epoch.DATE))
    assert replace(found, droop=None).flexure_words == "Tube flexure unknown: too few places."
    assert replace(found, droop=Measure(12.0, 45.4)).flexure_words == (
        "Tube flexure unknown (±45″): it needs more places, low ones too."
    )
    assert replace(found, droop=Measure(150.0, 45.4)).flexure == Measure(150.0, 45.4)


@pytest.mark.parametrize("site", SITES)
def test_the_axis_of_a_mount_that_counts_steps_is_named_from_three_places_on_both_sides(site) -> None:
    """Its offset in declination is the other way after the flip: it had been no single cause."""
    sightings = pointing_of(list(rig_frames(site, Build()))).sightings
    assert [investigate(sightings[:n]).cause for n in (3, 4, 6)] == ["polar axis"] * 3


def test_within_minutes_the_equinox_cannot_be_told_and_the_header_is_believed(night) -> None:
    """Precession of a quarter century looks like an axis that leans by a third of a degree."""
    seen = [replace(one, time_utc=night[1][0].time_utc) for one in night[1]]
    sidereal = [sidereal_deg(one.site, one.time_utc) for one in night[1]]
    back = [hour - sidereal[0] for hour in sidereal]
    frames = [
        replace(one, ra_deg=one.ra_deg - turn, reported_deg=(one.reported_deg[0] - turn, one.reported_deg[1]))
        for one, turn in zip(frames_of(seen, Epoch.DATE), back, strict=True)
    ]
    assert "whether their places are J2000" in why(frames)
    for epoch in Epoch:
        assert pointing_of([replace(one, epoch=epoch) for one in frames]).model.epoch is epoch


def test_where_a_tube_was_and_the_equinox_are_read_from_the_header() -> None:
    words = {"East": PierSide.EAST, "pierWest": PierSide.WEST, "WEST": PierSide.WEST, "Unknown": None, "": None}
    assert {word: _pier_side({"PIERSIDE": word}) for word in words} == words
    assert _pier_side({}) is None
    equinoxes = {2000.0: Epoch.J2000, "2000": Epoch.J2000, 2026.9: Epoch.DATE, 1950.0: None, "JNow": None, None: None}
    assert {equinox: _epoch({"EQUINOX": equinox}) for equinox in equinoxes} == equinoxes
