"""The doctor's verdict at each of its limits, and Bayes' theorem over the causes of a disagreement."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.core.frame import Detections, Frame, Hint, Site
from kochab.core.mount import Epoch, PierSide, Pointing, SiteReport
from kochab.core.solution import NoSolution, Reason
from kochab.pointing.disagreement import Cause, MountSighting, Seen, causes, fit, investigate, residuals, weigh
from kochab.solver import diagnosis
from kochab.solver.diagnosis import Evidence, diagnose
from kochab.solver.frame_quality import Bins, FrameLevels, Trails, measure_light, measure_trails
from tests.pointing.evidence import unexplained_arcsec

NAN = float("nan")
CLEAR = FrameLevels(0.01, 0.0, 50.0, 0.0, 1.0)
ROUND = Trails(0.0, 1.0, NAN, 0)


def stars(count, snr=20.0, **shapes):
    xy = np.random.default_rng(8).uniform(0.0, [799.0, 599.0], (count, 2))
    shapes = {"snr": snr, "fwhm_px": 3.0} | shapes
    plain = Detections.from_list(xy, 800, 600)
    return replace(plain, **{name: np.broadcast_to(value, count).copy() for name, value in shapes.items()})


@pytest.fixture
def verdict(monkeypatch):
    """The reason told of a frame whose light, trails and half-flux diameter are given."""

    def told(light=CLEAR, trails=ROUND, found=None, hfd_px=3.0, hint=None):
        monkeypatch.setattr(diagnosis, "measure_light", lambda *_: light)
        monkeypatch.setattr(diagnosis, "measure_trails", lambda *_: trails)
        monkeypatch.setattr(diagnosis, "half_flux_diameter_px", lambda *_: hfd_px)
        frame = Frame(np.zeros((600, 800), np.uint16))
        return diagnose(Evidence(stars(30) if found is None else found, hint, frame), None, {})

    return told


@pytest.mark.parametrize(
    ("share", "clear", "reason"),
    [
        (0.44, 0, Reason.TOO_FEW_STARS),
        (0.46, 0, Reason.CLOUDED_OR_DARK),
        (0.46, 30, Reason.CLOUDED_OR_DARK),
        (0.44, 30, Reason.NO_PATTERN_AGREED),
        (0.81, 30, Reason.CLOUDED_OR_DARK),
    ],
)
def test_daylight_begins_at_forty_five_hundredths_of_full_scale(verdict, share, clear, reason) -> None:
    found = stars(30, snr=np.where(np.arange(30) < clear, 20.0, 5.0))
    assert verdict(replace(CLEAR, background_share=share), found=found).reason is reason


@pytest.mark.parametrize(("share", "reason"), [(0.79, Reason.TRAILED), (0.81, Reason.CLOUDED_OR_DARK)])
def test_a_frame_nearly_white_is_daylight_whatever_else_it_shows(verdict, share, reason) -> None:
    trails = Trails(30.0, 4.0, 40.0, 20)
    assert verdict(replace(CLEAR, background_share=share), trails).reason is reason


@pytest.mark.parametrize(
    ("contrast", "snr", "dark"), [(3.9, 7.9, True), (4.1, 7.9, False), (3.9, 8.1, False), (3.9, NAN, False)]
)
def test_a_flat_frame_without_three_clear_stars_is_clouded(verdict, contrast, snr, dark) -> None:
    """A star without a signal to noise counts as clear."""
    found = stars(30, snr=np.where(np.arange(30) < 3, snr, 5.0))
    assert (verdict(replace(CLEAR, contrast=contrast), found=found).reason is Reason.CLOUDED_OR_DARK) is dark


@pytest.mark.parametrize(("clear", "reason"), [(2, Reason.CLOUDED_OR_DARK), (3, Reason.TRAILED)])
def test_three_clear_stars_let_another_fault_go_before_a_bright_sky(verdict, clear, reason) -> None:
    found = stars(30, snr=np.where(np.arange(30) < clear, 20.0, 5.0))
    trails = Trails(30.0, 4.0, 40.0, 20)
    assert verdict(replace(CLEAR, background_share=0.46), trails, found).reason is reason


@pytest.mark.parametrize(
    ("trails", "trailed"),
    [
        (Trails(11.0, 2.3, NAN, 8), True),
        (Trails(11.0, 2.3, NAN, 7), False),
        (Trails(11.0, 2.1, NAN, 8), False),
        (Trails(9.0, 2.3, NAN, 8), False),  # in all directions, and short
        (Trails(9.0, 2.3, 40.0, 8), True),
        (Trails(2.9, 2.3, 40.0, 8), False),  # shorter than a star is wide
        (Trails(3.1, 2.3, 40.0, 8), True),
    ],
)
def test_eight_patches_twice_as_long_as_wide_are_trails(verdict, trails, trailed) -> None:
    found = verdict(trails=trails, found=stars(30, elongation=1.0))
    assert (found.reason is Reason.TRAILED) is trailed
    assert ("trail_px" in found.measured) is trailed
    if trailed:
        assert found.measured["trail_px"] == trails.length_px
        assert (" in arcs" in found.advice) is bool(np.isnan(trails.angle_deg))


@pytest.mark.parametrize(
    ("count", "share", "aspect", "glare"),
    [
        (19, 0.0021, 1.9, True),
        (19, 0.0019, 1.9, False),
        (20, 0.0021, 1.9, False),
        (19, 0.0021, 2.1, False),
        (19, 0.39, 1.0, True),
        (19, 0.41, 1.0, False),
    ],
)
def test_a_bright_patch_hides_the_stars_when_few_are_left(verdict, count, share, aspect, glare) -> None:
    found = verdict(replace(CLEAR, glare_share=share, glare_aspect=aspect), found=stars(count))
    assert ("bright patch" in found.advice) is glare
    assert found.measured.get("glare_share") == (share if glare else None)
    if glare:
        assert f"{100.0 * share:.1f} % of the frame" in found.advice


@pytest.mark.parametrize(("share", "patch"), [(0.0099, False), (0.0101, True)])
def test_out_of_focus_a_patch_must_be_larger_than_a_star(verdict, share, patch) -> None:
    light = replace(CLEAR, glare_share=share)
    found = verdict(light, found=stars(10, fwhm_px=20.0), hfd_px=20.0)
    assert ("bright patch" in found.advice) is patch
    assert (found.reason is Reason.OUT_OF_FOCUS) is not patch


@pytest.mark.parametrize("fwhm_px", [15.0, 3.0])
def test_bumps_that_hardly_stand_out_are_no_stars_however_wide(verdict, fwhm_px) -> None:
    """Vignetting, glow and dust make them; stars as discs are looked for by their edges."""
    found = stars(30, snr=5.0, fwhm_px=fwhm_px)
    assert verdict(replace(CLEAR, contrast=3.0), found=found, hfd_px=fwhm_px).reason is Reason.CLOUDED_OR_DARK


@pytest.mark.parametrize(
    ("changed", "blurred"),
    [({}, True), ({"elongation": 1.4}, False), ({"fwhm_px": 31.0}, False), ({"snr": 7.0}, False)],
)
def test_wide_stars_are_round_clear_and_no_wider_than_a_disc(verdict, changed, blurred) -> None:
    told = {"snr": 20.0, "fwhm_px": 15.0} | changed
    found = verdict(found=stars(30, **told), hfd_px=told["fwhm_px"])
    assert (found.reason is Reason.OUT_OF_FOCUS) is blurred


@pytest.mark.parametrize(
    ("hfd_px", "fwhm_px", "blurred"), [(13.0, 11.0, False), (11.0, 13.0, False), (13.0, 12.5, True)]
)
def test_width_and_half_flux_diameter_must_both_say_that_the_focus_is_off(verdict, hfd_px, fwhm_px, blurred) -> None:
    found = verdict(found=stars(30, fwhm_px=fwhm_px), hfd_px=hfd_px)
    assert (found.reason is Reason.OUT_OF_FOCUS) is blurred
    assert found.measured["half_flux_diameter_px"] == hfd_px


def test_a_search_that_took_too_long_tells_how_long_and_what_was_measured() -> None:
    late = NoSolution(Reason.TIMED_OUT, "Allow more time.", "searched for 12.5 s")
    found = diagnose(Evidence(stars(7)), late, {"total": 1.0})
    assert (found.reason, found.tried, found.detections) == (Reason.TIMED_OUT, "searched for 12.5 s", 7)
    assert (found.measured["stars_found"], found.elapsed_ms) == (7.0, {"total": 1.0})


def test_the_hint_decides_which_advice_a_healthy_frame_gets(verdict) -> None:
    assert "Give the field of view" in verdict(hint=Hint()).advice
    assert "lights or noise" in verdict(hint=Hint(scale_arcsec_px=(50.0, 60.0))).advice


# -- Light and trails of frames that are made by hand -----------------------------------------------------


def test_a_frame_of_one_value_has_no_contrast_and_no_trails() -> None:
    flat = np.full((60, 80), 300.0)
    assert measure_trails(Bins(flat, 1)).count == 0
    assert np.isnan(measure_trails(Bins(flat, 1)).angle_deg)
    assert (measure_trails(Bins(flat, 1)).length_px, measure_trails(Bins(flat, 1)).aspect) == (0.0, 1.0)
    light = measure_light(Frame(flat.astype(np.uint16), saturation=1000.0), Bins(flat, 1))
    assert light == FrameLevels(0.3, 0.0, 0.0, 0.0, 1.0)


def test_steps_of_a_dark_frame_are_not_all_contrast() -> None:
    """Most pixels are equal: the noise is a fifth of the scatter that the others make."""
    dark = np.zeros((200, 200))
    dark[::20, ::20] = 10.0
    light = measure_light(Frame(dark.astype(np.uint16), saturation=100.0), Bins(dark, 1))
    sample = dark[::2, ::2]
    assert light.contrast == pytest.approx(10.0 / (0.2 * np.std(sample)))


def test_patches_that_point_everywhere_have_a_length_and_no_direction() -> None:
    pixels = np.random.default_rng(8).normal(200.0, 10.0, (600, 800))
    for k in range(8):
        y, x = 100 + 250 * (k // 4), 80 + 180 * (k % 4)
        for step in np.linspace(0.0, 40.0, 200):
            a = np.pi * k / 8.0
            row, column = int(y + 60 + step * np.sin(a)), int(x + step * np.cos(a))
            pixels[row : row + 3, column : column + 3] = 5000.0
    found = measure_trails(Bins(pixels, 1))
    assert found.count == 8
    assert np.isnan(found.angle_deg)
    assert found.length_px == pytest.approx(42.0, rel=0.1)


# -- Why mount and sky disagree --------------------------------------------------------------------------

TIME = datetime(2026, 7, 12, 22, 30, tzinfo=UTC)
SITE = Site(47.0, 8.5)


def sighting(ra_off=0.0, dec_off=0.0, sky=(200.0, 30.0), **more):
    plain = MountSighting(sky, Pointing(*sky, Epoch.J2000), TIME, SITE, **more)
    ra, dec = plain.expected_deg
    return replace(plain, reported=Pointing((ra + ra_off) % 360.0, dec + dec_off, Epoch.J2000))


def cause(off_deg, **more):
    """A cause that puts the mount so many degrees north of its report, with tiny terms and a single noise level."""
    tiny = dict.fromkeys(("offset", "axis", "cone"), (1e-6,)) | {"noise": (0.6,)}
    return Cause(
        f"{off_deg}",
        "Mend it.",
        lambda seen: seen.reported + np.array([0.0, off_deg]),
        **({"weight": 0.2} | tiny | more),
    )


@pytest.mark.parametrize("offsets", [(2.0,), (2.0, 3.5)])
def test_the_causes_share_the_probability_by_bayes_theorem(offsets) -> None:
    """Weight and a normal law on the sky, the mean of several where the noise is not known and large noise rare."""
    seen = Seen([sighting(dec_off=off) for off in offsets])
    tried = [cause(0.0), cause(0.5, weight=2.0), cause(0.7, noise=(0.3, 1.2)), cause(0.1, noise=(0.1,))]
    likelihood = []
    for c in tried:
        off = float(c.name)
        normal = [(np.exp(-0.5 * (off / s) ** 2) / (2.0 * np.pi * s**2)) ** len(offsets) for s in c.noise]
        likelihood.append(c.weight * np.average(normal, weights=[1.0 / (1.0 + (15.0 * s) ** 2) for s in c.noise]))
    unknown = [0.9 * np.exp(-r / 5.0) / (2.0 * np.pi * r * 5.0) + 0.1 / 41253.0 for r in offsets]
    total = sum(likelihood) + 0.3 * np.prod(unknown)
    found = weigh(seen, tried)
    expected = sorted((x / total for x in likelihood), reverse=True)
    assert [s.score for s in found] == pytest.approx(expected, rel=1e-3)
    for s in found:
        assert unexplained_arcsec(s) == pytest.approx(3600.0 * float(s.name), rel=0.01)


def test_what_the_mount_tells_of_itself_it_says_by() -> None:
    """Its clock and its longitude move right ascension."""
    told = SiteReport(site=Site(44.0, 12.0), time_utc=TIME + timedelta(minutes=20))
    seen = Seen([sighting(beliefs=told)])
    found = {c.name: c for c in causes(seen)}
    ((ra, dec),) = seen.expected
    assert found["clock"].would_say(seen)[0] == pytest.approx([ra + 5.0 * 1.00273790935, dec])
    assert found["site longitude"].would_say(seen)[0] == pytest.approx([ra + 3.5, dec])


def test_what_each_cause_would_have_the_mount_say() -> None:
    seen = Seen([sighting()])
    ((ra, dec),) = seen.expected
    said = {}
    for c in causes(seen):
        said.setdefault(c.name, []).append(c.would_say(seen)[0])
    hour = 15.0 * 1.00273790935
    assert [p[0] for p in said["summer time"]] == pytest.approx([ra - hour, ra + hour])
    assert said["pier side"] == [pytest.approx([ra + 180.0, dec])]
    assert said["longitude sign"] == [pytest.approx([ra - 17.0, dec])]
    assert said["hemisphere"][0] == pytest.approx([ra, -dec])
    assert len(said["hemisphere"]) == 2
    assert len(said["time zone"]) == 21


def test_an_offset_and_a_cone_are_fitted_to_all_sightings() -> None:
    """The mean of the offsets; and half the difference between the two sides of the pier."""
    east, west = {"pier_side": PierSide.EAST}, {"pier_side": PierSide.WEST}
    same = [sighting(1.5, 0.5, (200.0, 0.0), **east), sighting(1.5, 0.5, (230.0, 40.0), **west)]
    flipped = [sighting(0.5, 0.0, (200.0, 0.0), **east), sighting(-0.5, 0.0, (230.0, 0.0), **west)]
    for pair, name, terms in (
        (same, "not aligned", [1.5, 0.5, 0.0, 0.0, 0.0]),
        (flipped, "cone error", [0.0, 0.0, 0.0, 0.0, 0.5]),
    ):
        seen = Seen(pair)
        (free,) = [c for c in causes(seen) if c.name == name and not c.reverses]
        assert fit(seen, free)[1] == pytest.approx(terms, abs=0.01)
        assert weigh(seen, list(causes(seen)))[0].name == name


@pytest.mark.parametrize("ra", [0.2, 95.0, 180.0, 359.8])
@pytest.mark.parametrize("dec", [-60.0, 5.0])
def test_a_cause_is_named_wherever_right_ascension_begins_again(ra, dec) -> None:
    """What a mount would say is a place of the sky, on either side of 0 h."""
    for off, name in (
        (15.041, "summer time"),
        (-15.041, "summer time"),
        (180.0, "pier side"),
        (-17.0, "longitude sign"),
    ):
        found = investigate([sighting(off, 0.0, (ra, dec)), sighting(off, 0.02, ((ra + 0.5) % 360.0, dec))])
        assert found.cause == name
        assert unexplained_arcsec(found.suspects[0]) < 120.0
    told = SiteReport(site=Site(44.0, 12.0), time_utc=TIME + timedelta(minutes=20))
    seen = Seen([sighting(0.1, 0.1, (ra, dec), beliefs=told), sighting(0.1, 0.1, ((ra + 0.5) % 360.0, dec))])
    for c in causes(seen):
        assert (np.abs(c.would_say(seen)[:, 1]) <= 90.0).all(), c.name


@pytest.mark.parametrize("dec", [0.0, 60.0, 86.0, 88.0, 89.5])
def test_a_cone_moves_right_ascension_the_more_the_nearer_the_pole_up_to_twenty_times(dec) -> None:
    """Half a degree of cone seen at the equator, on both sides of the pier."""
    there = unit_vectors(np.array([20.0, 340.0]), np.array([dec, dec]))
    sides, terms = np.array([1.0, -1.0]), np.array([0.0, 0.0, 0.0, 0.0, 0.5])
    left, slopes = residuals(terms, there, there, sides, sides)
    narrow = np.cos(np.radians(dec))
    assert left[:, 0] / narrow == pytest.approx(-0.5 * sides / max(narrow, 0.05))
    assert slopes[:, 0, 4] * 0.5 == pytest.approx(-left[:, 0])
    assert left[:, 1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("aligned", "dec", "witness"), [(False, 30.0, 400.0), (False, 89.6, 400.0), (None, 89.6, 20.0), (None, 89.4, None)]
)
def test_a_mount_that_is_not_aligned_says_so_or_stands_at_the_pole(aligned, dec, witness) -> None:
    """Whatever it says fits, as likely as any place of the sky; its own word counts twice."""
    seen = Seen([replace(sighting(aligned=aligned), reported=Pointing(100.0, dec, Epoch.J2000))])
    found = [c for c in causes(seen) if c.name == "not aligned"]
    assert [(c.weight, c.noise) for c in found] == ([(pytest.approx(0.3 * witness), (60.0,))] if witness else [])
    for c in found:
        assert c.would_say(seen)[0] == pytest.approx([100.0, dec])
        assert ("reports that it is not aligned" in c.evidence) is (witness == 400.0)


@pytest.mark.parametrize(("longitude", "asked"), [(0.9, False), (1.1, True), (-1.1, True)])
def test_east_and_west_are_not_mistaken_within_a_degree_of_greenwich(longitude, asked) -> None:
    found = causes(Seen([replace(sighting(), site=Site(47.0, longitude))]))
    assert ("longitude sign" in {c.name for c in found}) is asked


@pytest.mark.parametrize(("latitude", "witness"), [(0.9, 1.0), (1.1, 20.0), (-1.1, 0.02)])
def test_a_hemisphere_is_confirmed_or_denied_beyond_a_degree_from_the_equator(latitude, witness) -> None:
    told = SiteReport(site=Site(-47.0, 8.5))
    seen = Seen([replace(sighting(beliefs=told), site=Site(latitude, 8.5))])
    found = [c.weight for c in causes(seen) if c.name == "hemisphere"]
    assert found == pytest.approx([0.05 * witness, 0.03 * witness])
