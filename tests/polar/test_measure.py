"""A measurement as its callers get it: the error's sign and size, and everything worth saying."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.core.camera import Camera
from kochab.polar.axis_fit import fit_axis
from kochab.polar.flexure import Droop
from kochab.polar.live import LivePhase
from kochab.polar.measure import Measurement, MeasureSettings, NoAxis, PolarFindingKind, measure_local, slipping
from kochab.polar.pole import Pole, pole_direction
from kochab.sky.horizon import Refraction
from tests.polar.mounts import ARCSEC, Mount
from tests.polar.test_flexure import bent

VACUUM = Refraction(pressure_hpa=0.0)


def measured(mount, turns, seed=1, pole=Pole.TRUE, **seeing):
    settings = MeasureSettings(mount.site, pole, VACUUM)
    return measure_local(mount.see(turns, np.random.default_rng(seed), **seeing), settings)


def kinds(measurement):
    return {finding.kind for finding in measurement.findings}


@pytest.mark.parametrize("latitude", [-60.0, -20.0, 0.5, 40.0, 70.0])
@pytest.mark.parametrize(("d_alt", "d_az"), [(900.0, 0.0), (0.0, 3600.0), (-1500.0, -700.0)])
def test_signs_hold_in_both_hemispheres(latitude, d_alt, d_az):
    found = measured(Mount(latitude, d_alt, d_az), [0, 30, 60, 90])
    assert isinstance(found, Measurement)
    assert found.error.altitude_arcsec == pytest.approx(d_alt, abs=25)
    az_sigma = found.error.sigma_azimuth_arcsec
    assert found.error.azimuth_arcsec == pytest.approx(d_az, abs=max(25, 4 * az_sigma))
    assert found.turn_deg == pytest.approx(90.0, abs=0.1)
    assert found.rho_deg == pytest.approx(60.0, abs=0.1)


def test_tracking_between_the_frames_changes_nothing():
    still = measured(Mount(40.0, 600.0, 400.0), [0, 30, 60])
    tracked = measured(Mount(40.0, 600.0, 400.0), [0, 30.25, 60.5])
    assert tracked.error.altitude_arcsec == pytest.approx(still.error.altitude_arcsec, abs=1.0)
    assert tracked.error.azimuth_arcsec == pytest.approx(still.error.azimuth_arcsec, abs=1.0)


def test_a_good_sweep_says_only_that_flexure_is_unseen():
    found = measured(Mount(40.0, 600.0, 400.0), [0, 20, 40, 60])
    assert kinds(found) == {PolarFindingKind.FLEXURE_NOT_MEASURED}


def test_too_few_or_too_alike_frames_are_refused_with_advice():
    one = measured(Mount(), [0])
    assert isinstance(one, NoAxis)
    assert "two frames" in one.reason
    alike = measured(Mount(), [0, 0.1, 0.2])
    assert isinstance(alike, NoAxis)
    assert "rotated by only" in alike.reason
    assert "30°" in alike.advice


def test_a_small_turn_is_told_with_what_it_is_worth():
    assert PolarFindingKind.TURN_TOO_SMALL in kinds(measured(Mount(), [0, 1.5]))
    small = measured(Mount(), [0, 10])
    assert PolarFindingKind.SMALL_TURN in kinds(small)
    assert PolarFindingKind.FLEXURE_NOT_MEASURED not in kinds(small)  # too poor to matter


def test_a_low_frame_and_one_below_the_horizon():
    low = measured(Mount(40.0, rho_deg=70.0, hour_deg=70.0), [0, 10, 20])
    assert PolarFindingKind.LOW in kinds(low)
    below = measured(Mount(40.0, rho_deg=90.0, hour_deg=60.0), [0, 20, 60])
    assert PolarFindingKind.SITE_OR_TIME in kinds(below)


def test_an_axis_far_from_the_pole_is_doubted():
    mount = Mount(40.0, 0.0, 0.0)
    wrong = MeasureSettings(Mount(15.0).site, Pole.TRUE, VACUUM)
    found = measure_local(mount.see([0, 30, 60]), wrong)
    assert PolarFindingKind.FAR in kinds(found)


@pytest.mark.parametrize(("latitude", "told"), [(0.0, True), (-8.0, True), (40.0, False)])
def test_near_the_equator_the_refracted_pole_is_doubted(latitude, told):
    mount = Mount(latitude, 600.0, 400.0)
    for pole in Pole:
        found = measure_local(mount.see([0, 20, 40, 60]), MeasureSettings(mount.site, pole))
        assert (PolarFindingKind.POLE in kinds(found)) == (told and pole is not Pole.TRUE)


def test_two_frames_say_that_nothing_checks_them():
    assert PolarFindingKind.UNCHECKED in kinds(measured(Mount(), [0, 40]))
    assert PolarFindingKind.UNCHECKED not in kinds(measured(Mount(), [0, 20, 40]))


def test_residuals_that_are_too_large_widen_the_live_error_too():
    """What the adjusting phase leans on is no surer than the measurement that it came from."""
    from kochab.polar.live import LivePhase

    mount = Mount(40.0, 600.0, 400.0)
    quiet = mount.see([0, 15, 30, 45, 60, 75], np.random.default_rng(3))
    claimed = [type(a)(a.matrix, a.covariance / 100.0, a.time_utc, a.label) for a in quiet]
    found = measure_local(claimed, MeasureSettings(mount.site, Pole.TRUE, VACUUM))
    live = LivePhase(found).update(quiet[-1])
    shared = live.error.covariance - live.frame_covariance
    assert np.trace(found.error.covariance) > 20 * np.trace(fit_axis(claimed, mount.pole).covariance)
    assert np.trace(shared) > 0.5 * np.trace(found.error.covariance)
    assert live.error.flexure_arcsec == found.error.flexure_arcsec


def dec_moved(mount, arcmin):
    """A turn about the declination axis, which is across boresight and polar axis."""
    matrix = mount.attitude(0.0)
    across = np.cross([0, 0, 1.0], matrix.T @ mount.axis)
    across /= np.linalg.norm(across)
    return Rotation.from_rotvec(across * arcmin * 60.0 * ARCSEC).as_matrix()


@pytest.mark.parametrize("after", [1, 2, 3])
def test_a_declination_axis_that_moved_is_named_with_place_and_size(after):
    mount = Mount(40.0, 600.0, 400.0)
    found = measured(mount, [0, 20, 40, 60], after=(after, dec_moved(mount, 6.0)))
    assert PolarFindingKind.DEC_MOVED in kinds(found)
    assert found.movement.after == f"frame {after + 1}"
    assert abs(found.movement.angle_arcsec) == pytest.approx(360.0, abs=90)
    assert "Lock it" in next(f.text for f in found.findings if f.kind is PolarFindingKind.DEC_MOVED)


@pytest.mark.parametrize("arcmin", [5.0, 60.0])
def test_the_axis_is_the_one_that_knows_of_the_movement(arcmin):
    """Without that it is off by as much as declination moved, and more."""
    scaled, said_arcsec = [], []
    for seed in range(20):
        mount = Mount(40.0, 600.0, 400.0)
        found = measured(mount, [0, 15, 30, 45, 60], seed, after=(1 + seed % 4, dec_moved(mount, arcmin)))
        assert not found.spoilt
        off = np.linalg.norm(found.error.axis - mount.axis) / ARCSEC
        assert off < 6.0 * found.error.uncertainty_arcsec
        said_arcsec.append(found.error.uncertainty_arcsec)
        scaled.append(found.error.distance2(mount.axis))
    assert np.mean(np.array(scaled) < 5.99) > 0.8
    assert np.median(said_arcsec) < 60.0
    assert np.mean(scaled) > 0.6  # two degrees of freedom: 2; less, for it holds a kick of the tripod as well


@pytest.mark.parametrize("what", ["sinking", "creep", "wobble"])
def test_the_ellipse_holds_an_axis_whose_frames_moved_all_the_time(what):
    """A tripod that sinks by 60 arcsec, a camera that creeps by 90, a bearing that wobbles by 40."""
    held, offs = [], []
    for seed in range(8):
        rng = np.random.default_rng([7, seed])
        mount = Mount(40.0, 600.0, 400.0, sigma=1.0, sigma_roll=4.0, hour_deg=-45.0)
        way = rng.normal(size=3) * ([1.0, 1.0, 0.0] if what == "sinking" else 1.0)
        way *= ARCSEC * (60.0 if what == "sinking" else 90.0) / np.linalg.norm(way)
        seen = mount.see([0, 4, 30, 36, 60, 64, 75], rng)  # even steps hide what grows evenly
        for k, frame in enumerate(seen):
            slow, own = (Rotation.from_rotvec(v).as_matrix() for v in (way * k / 6.0, rng.normal(size=3) * 28 * ARCSEC))
            matrix = slow @ frame.matrix if what == "sinking" else frame.matrix @ (slow if what == "creep" else own)
            seen[k] = replace(frame, matrix=matrix)
        found = measure_local(seen, MeasureSettings(mount.site, Pole.TRUE, VACUUM))
        assert found.movement is None or not found.movement.explains
        axis = Rotation.from_rotvec(way * (what == "sinking")).apply(mount.axis)  # as it stands at the last frame
        held.append(found.error.distance2(axis) < 5.99)
        offs.append(np.linalg.norm(found.error.axis - axis) / ARCSEC)
    assert np.mean(held) > 0.8
    assert np.median(offs) < {"sinking": 30.0, "creep": 30.0, "wobble": 90.0}[what]


def test_the_live_phase_goes_on_from_where_declination_moved_to():
    mount = Mount(40.0, 600.0, 400.0)
    moved = dec_moved(mount, 60.0)
    seen = mount.see([0, 15, 30, 45, 60], after=(2, moved))
    found = measure_local(seen, MeasureSettings(mount.site, Pole.TRUE, VACUUM))
    later = mount.see([60, 60, 60, 60, 60], after=(2, moved))[-1]
    seen = LivePhase(found).update(later)
    assert seen.error.altitude_arcsec == pytest.approx(600.0, abs=1.0)
    assert seen.error.azimuth_arcsec == pytest.approx(400.0, abs=1.0)


def test_a_movement_that_does_not_explain_everything_spoils():
    """The tripod was knocked besides."""
    mount, knocked = Mount(40.0, 600.0, 400.0), Mount(40.0, 600.0, 1000.0)
    first = mount.see([0, 15, 30], after=(1, dec_moved(mount, 60.0)))
    later = knocked.see([0, 15, 30, 45, 60], after=(0, dec_moved(mount, 60.0)))[3:]
    found = measure_local(first + later, MeasureSettings(mount.site, Pole.TRUE, VACUUM))
    assert found.movement is None, "two things moved, and none alone explains it"
    assert found.spoilt
    assert said(found, "DISAGREE")[0].endswith("start again.")


def test_frames_of_two_nights_are_no_measurement():
    mount = Mount(40.0, 600.0, 400.0)
    settings = MeasureSettings(mount.site, Pole.TRUE, VACUUM)
    for hours, spoilt in ((7.9, False), (23.0, True)):
        *early, last = mount.see([0, 30, 60])
        frames = [*early, replace(last, time_utc=early[-1].time_utc + timedelta(hours=hours))]
        found = measure_local(frames, settings)
        assert found.spoilt is spoilt
        assert ("frame 2 and frame 3 are 23 h apart" in "".join(said(found, "NIGHTS"))) is spoilt


@pytest.mark.parametrize(
    ("second", "spoilt"),
    [
        (Camera.centred(800, 600, 3000.0), False),  # binned
        (Camera.centred(1600, 1200, 6040.0), False),  # refraction squeezes low frames
        (Camera.centred(1600, 1200, 6200.0), True),
        (Camera.centred(1600, 1000, 6000.0), True),
        (Camera.centred(1600, 1200, 6000.0, mirrored=True), True),
    ],
)
def test_two_cameras_are_no_measurement(second, spoilt):
    mount = Mount(40.0, 600.0, 400.0)
    cameras = [Camera.centred(1600, 1200, 6000.0)] * 2 + [second]
    frames = [replace(f, camera=c) for f, c in zip(mount.see([0, 30, 60]), cameras, strict=True)]
    found = measure_local(frames, MeasureSettings(mount.site, Pole.TRUE, VACUUM))
    assert found.spoilt is spoilt
    told = "".join(said(found, "TWO_CAMERAS")) + "".join(said(found, "CROPPED"))
    words = "frame 3 is cropped" if second.height == 1000 else "frame 2 and frame 3 are of different cameras"
    assert (words in told) is spoilt


@pytest.mark.parametrize(("turn", "spoilt"), [(1.9, True), (2.1, False)])
def test_a_turn_of_two_degrees_is_the_least_to_turn_a_bolt_by(turn, spoilt):
    assert measured(Mount(sigma=0.2, sigma_roll=1.0), [0, turn / 2, turn]).spoilt is spoilt


def test_a_camera_that_turned_in_its_holder_is_named():
    mount = Mount(40.0, 600.0, 400.0)
    turn = Rotation.from_euler("z", 0.5, degrees=True).as_matrix()
    found = measured(mount, [0, 20, 40, 60], after=(2, turn))
    assert PolarFindingKind.CAMERA_TURNED in kinds(found)
    assert abs(found.movement.angle_arcsec) == pytest.approx(1800.0, rel=0.1)


def test_frames_that_nothing_explains_widen_the_ellipse():
    mount = Mount(40.0, 600.0, 400.0, sigma=60.0)
    rng = np.random.default_rng(3)
    shaken = mount.see([0, 15, 30, 45, 60, 75], rng)
    claimed = [type(a)(a.matrix, a.covariance / 900.0, a.time_utc, a.label) for a in shaken]
    found = measure_local(claimed, MeasureSettings(mount.site, Pole.TRUE, VACUUM))
    assert PolarFindingKind.DISAGREE in kinds(found)
    assert found.error.covariance[0, 0] > 20 * fit_axis(claimed, mount.pole).covariance[0, 0]


def test_small_residuals_beyond_noise_are_no_fault():
    mount = Mount(40.0, 600.0, 400.0, sigma=5.0, sigma_roll=5.0)
    shaken = mount.see([0, 15, 30, 45, 60, 75], np.random.default_rng(4))
    claimed = [type(a)(a.matrix, a.covariance / 25.0, a.time_utc, a.label) for a in shaken]
    found = measure_local(claimed, MeasureSettings(mount.site, Pole.TRUE, VACUUM))
    assert PolarFindingKind.SCATTER_TOO_LARGE in kinds(found)
    assert not {PolarFindingKind.DISAGREE, PolarFindingKind.DEC_MOVED, PolarFindingKind.CAMERA_TURNED} & kinds(found)
    assert found.error.covariance[0, 0] > 10 * fit_axis(claimed, mount.pole).covariance[0, 0]


def test_a_second_sweep_shows_flexure_or_frees_from_the_doubt():
    mount = Mount(40.0, 600.0, 400.0, hour_deg=-45.0)
    other = Mount(40.0, 600.0, 400.0, rho_deg=30.0, hour_deg=-45.0)
    bent = Mount(40.0, 600.0, 500.0, rho_deg=30.0, hour_deg=-45.0)
    settings = MeasureSettings(mount.site, Pole.TRUE, VACUUM)
    rng = np.random.default_rng(8)
    first = mount.see([0, 30, 60, 90], rng)
    both = measure_local(first + other.see([0, 30, 60, 90], rng, sweep=1), settings)
    alone = measure_local(first, settings)
    assert kinds(both) == set()
    assert len(both.results) == 2
    assert both.error.with_systematics.uncertainty_arcsec < alone.error.with_systematics.uncertainty_arcsec
    assert both.droop.sigma_arcsec < 0.8 * alone.droop.sigma_arcsec
    assert both.error.total_arcsec == pytest.approx(alone.error.total_arcsec, abs=20)
    flexed = measure_local(first + bent.see([0, 30, 60, 90], rng, sweep=1), settings)
    assert PolarFindingKind.FLEXURE in kinds(flexed)
    assert flexed.error.uncertainty_arcsec > 3 * both.error.uncertainty_arcsec


def test_a_slipping_clutch_is_the_gap_between_asked_and_done():
    assert slipping(30.0, 29.0) is None
    assert slipping(-30.0, 30.4) is None
    found = slipping(30.0, 21.0)
    assert found.kind is PolarFindingKind.SLIPPING
    assert "30°" in found.text
    assert "21°" in found.text
    assert slipping(20.0, 35.0) is not None


def test_systematics_have_the_expected_size():
    """A clock 60 s wrong with the mount 48' off: 13 arcsec; a latitude wrong: as much, nearly."""
    from kochab.core.attitude import Attitude
    from kochab.polar.measure import measure
    from kochab.polar.rotations import best_rotation
    from kochab.polar.sighting import Sighting
    from kochab.sky.horizon import Horizon

    mount = Mount(40.0, 0.0, 48.0 * 60.0 / np.cos(np.radians(40.0)))

    def sighting(turn, k):
        """The ICRS attitude whose field the horizon's own transform puts where the mount looks."""
        when = mount.see([0])[0].time_utc + timedelta(seconds=60 * k)
        stars = Rotation.random(400, np.random.default_rng(4)).apply([0, 0, 1.0])
        seen = Horizon(mount.site, when, VACUUM).observed(stars)
        near = seen @ mount.attitude(turn)[:, 2] > 0.95
        matrix = best_rotation(stars[near], seen[near] @ mount.attitude(turn))
        return Sighting(Attitude(matrix, np.eye(3) * (2 * ARCSEC) ** 2), when, (0.2, 0.2))

    sightings = [sighting(t, k) for k, t in enumerate([0, 30, 60])]
    settings = MeasureSettings(mount.site, Pole.TRUE, VACUUM)
    right = measure(sightings, settings)
    assert right.error.azimuth_on_sky_arcsec == pytest.approx(48 * 60.0, abs=1.0)
    late = [Sighting(s.attitude, s.time_utc + timedelta(seconds=60), s.field_deg) for s in sightings]
    wrong = measure(late, settings)
    from kochab.core.attitude import angle_between

    assert angle_between(wrong.error.axis, right.error.axis) / ARCSEC == pytest.approx(12.6, abs=1.0)


def test_two_measurements_of_an_axis_at_rest_are_surer_together():
    from kochab.polar.measure import combine_measurements

    first = measured(Mount(40.0, 20.0, 10.0), [0, 30, 60], seed=1)
    again = measured(Mount(40.0, 20.0, 10.0), [0, 30, 60], seed=5)
    both = combine_measurements(first, again)
    assert both.error.uncertainty_arcsec < 0.9 * first.error.uncertainty_arcsec
    low, high = sorted(m.error.altitude_arcsec for m in (first, again))
    assert low < both.error.altitude_arcsec < high
    kicked = measured(Mount(40.0, 220.0, 10.0), [0, 30, 60], seed=5)
    assert combine_measurements(first, kicked).error.uncertainty_arcsec > 2 * first.error.uncertainty_arcsec


@pytest.mark.parametrize(
    ("asked", "turned", "slips"), [(30.0, 25.7, False), (30.0, 25.3, True), (30.0, 34.3, False), (-30.0, 34.7, True)]
)
def test_a_clutch_slips_by_more_than_a_degree_and_a_half_and_a_tenth(asked, turned, slips):
    assert (slipping(asked, turned) is not None) is slips


@pytest.mark.parametrize(
    ("turn", "kind"),
    [(1.9, "TURN_TOO_SMALL"), (2.1, "SMALL_TURN"), (14.5, "SMALL_TURN"), (15.5, None), (0.26, "TURN_TOO_SMALL")],
)
def test_how_far_ra_has_to_turn(turn, kind):
    found = kinds(measured(Mount(sigma=0.2, sigma_roll=1.0), [0, turn / 2, turn]))
    told = found & {PolarFindingKind.TURN_TOO_SMALL, PolarFindingKind.SMALL_TURN}
    assert told == ({PolarFindingKind[kind]} if kind else set())


def test_a_quarter_degree_gives_no_axis_at_all():
    assert isinstance(measured(Mount(sigma=0.2, sigma_roll=1.0), [0, 0.24]), NoAxis)
    small_steps = measured(Mount(sigma=0.2, sigma_roll=1.0), [0, 0.2, 0.4])
    assert isinstance(small_steps, Measurement)


@pytest.mark.parametrize(("altitude", "low"), [(14.0, True), (16.0, False), (0.5, True)])
def test_frames_below_fifteen_degrees_are_low(altitude, low):
    """The meridian below the pole: the boresight of the middle frame is as high as it gets there."""
    mount = Mount(60.0, rho_deg=60.0 - altitude, hour_deg=0.0)
    lowest = min((mount.attitude(t)[2, 2], t) for t in range(0, 360, 5))[1]
    found = measured(mount, [lowest - 20, lowest, lowest + 20])
    assert np.degrees(np.arcsin(mount.attitude(lowest)[2, 2])) == pytest.approx(altitude, abs=0.3)
    assert (PolarFindingKind.LOW in kinds(found)) is low


@pytest.mark.parametrize(("degrees", "far"), [(9.5, False), (10.5, True)])
def test_ten_degrees_from_the_pole_are_far(degrees, far):
    found = measured(Mount(40.0, degrees * 3600.0, 0.0), [0, 30, 60])
    assert (PolarFindingKind.FAR in kinds(found)) is far


def test_a_droop_known_before_is_no_finding_of_one_sweep():
    """What earlier sweeps have shown is used, and told only by sweeps that show it."""
    mount, other = Mount(40.0, 600.0, 400.0, rho_deg=20.0), Mount(40.0, 600.0, 400.0, rho_deg=80.0)
    settings = MeasureSettings(mount.site, Pole.TRUE, VACUUM)
    known = Droop(40.0, 2.0)
    first, second = (bent(m.see([0, 20, 40, 60], sweep=k), 40.0) for k, m in enumerate((mount, other)))
    one = measure_local(first, settings, known)
    assert one.droop.arcsec == pytest.approx(40.0, abs=0.1)
    assert kinds(one) == set()
    assert kinds(measure_local(first + second, settings, known)) == {PolarFindingKind.DROOP}


def test_sweeps_that_disagree_say_by_how_much_the_first_and_the_last():
    first, last = Mount(40.0, 600.0, 400.0, rho_deg=30.0), Mount(40.0, 600.0, 700.0, rho_deg=30.0)
    settings = MeasureSettings(first.site, Pole.TRUE, VACUUM)
    turns = [0, 30, 60, 90]
    frames = first.see(turns) + first.see(turns, sweep=1) + last.see(turns, sweep=2)
    said = next(f.text for f in measure_local(frames, settings).findings if f.kind is PolarFindingKind.FLEXURE)
    apart = 300.0 * np.cos(np.radians(40.0))
    assert f"disagree by {apart / 60.0:.1f}′" in said


def test_the_time_of_a_measurement_is_that_of_its_last_frame():
    found = measured(Mount(40.0, 600.0, 400.0), [0, 30, 60], seconds=45.0)
    assert found.time_utc == found.attitudes[-1].time_utc
    assert found.time_utc - found.attitudes[0].time_utc == timedelta(seconds=90)
    assert found.last_of_fit is found.attitudes[-1]


@pytest.mark.parametrize(("pressure_hpa", "told"), [(170.0, False), (230.0, True)])
def test_a_pole_is_doubted_when_the_air_lifts_it_by_an_arcminute(pressure_hpa, told):
    """At a latitude of 14 degrees the usual air lifts it by four; a fifth of it is left so high up."""
    mount = Mount(14.0, 600.0, 400.0)
    settings = MeasureSettings(mount.site, Pole.REFRACTED, Refraction(pressure_hpa=pressure_hpa * 1.2))
    lifted = (np.arcsin(pole_direction(settings.site, settings.pole, settings.refraction)[2]) / ARCSEC) - 14.0 * 3600.0
    assert bool(lifted > 60.0) is told
    assert 40.0 < lifted < 80.0
    assert (PolarFindingKind.POLE in kinds(measure_local(mount.see([0, 20, 40, 60]), settings))) is told


@pytest.mark.parametrize(("latitude", "told"), [(14.5, True), (15.5, False), (-14.5, True), (-15.5, False)])
def test_the_pole_is_doubted_within_fifteen_degrees_of_the_equator(latitude, told):
    mount = Mount(latitude, 600.0, 400.0)
    found = measure_local(mount.see([0, 20, 40, 60]), MeasureSettings(mount.site, Pole.REFRACTED))
    assert (PolarFindingKind.POLE in kinds(found)) is told


# -- Every finding to the letter ------------------------------------------------------------------------


def said(measurement, kind):
    return [finding.text for finding in measurement.findings if finding.kind is PolarFindingKind[kind]]


@pytest.mark.parametrize("label", ["frame 3", ""])
def test_the_lowest_frame_is_named_with_its_altitude(label):
    mount = Mount(40.0, rho_deg=90.0, hour_deg=60.0)
    frames = [replace(a, label=a.label and label) for a in mount.see([0, 20, 60])]
    deepest = min(np.degrees(np.arcsin(mount.attitude(turn)[2, 2])) for turn in (0, 20, 60))
    assert deepest < -20.0
    found = measure_local(frames, MeasureSettings(mount.site, Pole.TRUE, VACUUM))
    name = label or "A frame"
    assert said(found, "SITE_OR_TIME") == [
        f"{name} would be {-deepest:.0f}° below the horizon. Check the site, the time and the time zone."
    ]
    assert said(found, "LOW") == []
    low = Mount(40.0, rho_deg=70.0, hour_deg=70.0)
    frames = [replace(a, label=a.label and label) for a in low.see([20, 10, 0])]
    altitudes = [np.degrees(np.arcsin(low.attitude(turn)[2, 2])) for turn in (20, 10, 0)]
    assert np.argmin(altitudes) in (0, 2)
    frames[int(np.argmin(altitudes))] = replace(frames[int(np.argmin(altitudes))], label=label)
    assert said(measure_local(frames, MeasureSettings(low.site, Pole.TRUE, VACUUM)), "LOW") == [
        f"{name} is only {min(altitudes):.0f}° above the horizon, where refraction is large and hard to predict."
        " Stay above 15°."
    ]


def test_a_movement_and_its_cure_are_told():
    mount = Mount(40.0, 600.0, 400.0)
    found = measured(mount, [0, 15, 30, 45, 60], after=(2, dec_moved(mount, 60.0)))
    assert said(found, "DEC_MOVED") == [
        f"Declination moved by {abs(found.movement.angle_arcsec) / 60.0:.1f}′ between frame 2 and frame 3."
        " Lock it; the axis allows for it."
    ]
    turned = measured(mount, [0, 15, 30, 45, 60], after=(3, Rotation.from_euler("z", 2.0, degrees=True).as_matrix()))
    assert said(turned, "CAMERA_TURNED") == [
        "The camera rotated in its holder by 2.00° between frame 3 and frame 4. Tighten it; the axis allows for it."
    ]


def test_how_little_was_turned_and_how_much_is_not_known_are_told():
    quiet = Mount(sigma=0.2, sigma_roll=1.0)
    alike, small = measured(quiet, [0, 1.5]), measured(quiet, [0, 10])
    assert said(alike, "TURN_TOO_SMALL")[0].startswith("RA rotated by only 1.5°: ± ")
    assert said(alike, "TURN_TOO_SMALL")[0].endswith("at best. Rotate by at least 30°.")
    sigma = small.results[0].error.uncertainty_arcsec
    assert said(small, "SMALL_TURN") == [f"RA rotated by only 10°: the uncertainty is {sigma:.0f}″. Rotate further."]
    steady = measured(Mount(40.0, 600.0, 400.0), [0, 20, 40, 60])
    assert said(steady, "FLEXURE_NOT_MEASURED") == [
        f"Flexure not measured (±{steady.error.flexure_total_arcsec:.0f}″ assumed). Sweep again at another"
        " declination to measure it."
    ]
    assert said(measured(Mount(40.0, 11.0 * 3600.0, 0.0), [0, 30, 60]), "FAR") == [
        "The axis is 11° from the pole. Check the site and the time, and that only RA turned."
    ]


def test_frames_that_scatter_tell_by_how_much():
    mount = Mount(40.0, 600.0, 400.0)
    for sigma, kind in ((5.0, "SCATTER_TOO_LARGE"), (60.0, "DISAGREE")):
        shaken = replace(mount, sigma=sigma, sigma_roll=sigma).see([0, 15, 30, 45, 60, 75], np.random.default_rng(4))
        claimed = [
            replace(a, covariance=a.covariance / (25.0 if kind == "SCATTER_TOO_LARGE" else 900.0)) for a in shaken
        ]
        found = measure_local(claimed, MeasureSettings(mount.site, Pole.TRUE, VACUUM))
        worst = np.abs(found.fit.residuals[:, :2]).max() / ARCSEC
        (text,) = said(found, kind)
        size = f"up to {worst:.0f}″" if worst < 99.5 else f"({worst / 60.0:.1f}′ apart)"
        assert size in text or f"({worst:.0f}″ apart)" in text
        assert bool(worst < 60.0) is (kind == "SCATTER_TOO_LARGE")


@pytest.mark.parametrize(("droop", "word"), [(50.0, "sags"), (-50.0, "rises")])
def test_a_tube_sags_or_rises_with_its_error(droop, word):
    mount, other = Mount(40.0, 600.0, 400.0, rho_deg=20.0), Mount(40.0, 600.0, 400.0, rho_deg=80.0)
    settings = MeasureSettings(mount.site, Pole.TRUE, VACUUM)
    frames = [a for k, m in enumerate((mount, other)) for a in bent(m.see([0, 20, 40, 60], sweep=k), droop)]
    found = measure_local(frames, settings)
    assert said(found, "DROOP") == [
        f"The tube {word} by {abs(found.droop.arcsec):.0f}″ ± {found.droop.sigma_arcsec:.0f}″ from zenith to horizon."
        " The axis is corrected for it."
    ]
    assert abs(found.droop.arcsec) > 35.0


def test_why_there_is_no_axis_is_one_sentence_and_what_to_do_another():
    assert measured(Mount(), [0]).sentence == (
        "An axis needs at least two frames of one sweep. Rotate RA and take another frame."
    )
    assert measured(Mount(sigma=0.2, sigma_roll=1.0), [0, 0.2]).sentence.startswith("RA rotated by only 0.20° between")
