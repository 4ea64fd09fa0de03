"""What is under the cursor is told, and a click opens its card."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from kochab.core.attitude import unit_vectors
from kochab.core.frame import Site
from kochab.sky.horizon import Horizon, Refraction
from kochab.sky.layer import in_frame
from kochab.sky.sky_tables import sky_tables
from kochab.sky.solar_system import BodyKind
from kochab.text.angle_text import AngleStyle
from kochab.window.image.object_card import facts, heights
from kochab.window.image.overlay import Overlay
from tests.window.fakes import fake_solution
from tests.window.image.test_frame_view import jupiter_at, painted

EVENING = datetime(2026, 1, 12, 19, 0, tzinfo=UTC)
PLACES = {"Munich": Site(48.1, 11.6, 500.0), "Sydney": Site(-33.9, 151.2, 10.0), "Quito": Site(-0.2, -78.5, 2800.0)}


def mark_of(name):
    solution = fake_solution(600, 400)
    return next(mark for mark in in_frame(sky_tables(), solution).marks if mark.short == name), solution


def test_an_objects_card():
    mark, solution = mark_of("NGC 2024")
    told = facts(sky_tables(), mark, solution, AngleStyle.SEXAGESIMAL, None)
    assert told[""] == "Nebula"
    assert told["In"] == "Orion"
    assert told["Size"] == "30′ × 30′"
    assert "Tank Tracks Nebula" in told["Also"]
    assert "Sh2-277" in told["Also"]
    assert "Now" not in told


def test_a_stars_card():
    mark, solution = mark_of("Alnilam")
    told = facts(sky_tables(), mark, solution, AngleStyle.SEXAGESIMAL, Horizon(PLACES["Munich"], EVENING))
    assert (told[""], told["V"], told["Catalogue"], told["Residual"]) == ("Star", "1.69", "HIP 26311", "not matched")
    assert told["Now"].endswith("° high")
    assert told["Highest"].startswith("41° at ")  # 90 - 48.1 - 1.2, and refraction


@pytest.mark.parametrize(
    ("hip", "arcsec", "pa_deg", "mag"),
    [(65378, 14.4, 152.0, 3.9), (36850, 3.1, 76.0, 3.0), (50583, 4.6, 125.0, 3.6), (86228, 6.5, 315.0, 5.4)],
    ids=["Mizar", "Castor", "Algieba", "theta Sco"],
)
def test_a_double_stars_card_has_its_companion_as_in_the_wds_of_1991(hip, arcsec, pa_deg, mag):
    """WDS 13239+5456, 07346+3153, 10200+1950 and 17373-4300, observed in 1991."""
    stars, solution = sky_tables().stars, fake_solution(600, 400)
    row = stars.hip.tolist().index(hip)
    assert stars.pair[row] == pytest.approx((arcsec, pa_deg, mag), abs=1.0)
    assert stars.pair[row, 0] == pytest.approx(arcsec, abs=0.1)
    told = facts(sky_tables(), replace(mark_of("Alnilam")[0], row=row), solution, AngleStyle.SEXAGESIMAL, None)
    assert told["Double"].startswith(f"{stars.pair[row, 0]:.1f}″ at {stars.pair[row, 1]:.0f}°, ")
    single = facts(sky_tables(), mark_of("Alnilam")[0], solution, AngleStyle.SEXAGESIMAL, None)
    assert "Double" not in single


@pytest.mark.parametrize(
    ("hip", "said"),
    [
        (10826, "Mira star, V 2–10.1, period 331.96 d"),
        (14576, "eclipsing, V 2.12–3.39, period 2.8673 d"),
        (110991, "Cepheid, V 3.48–4.37, period 5.3662 d"),
        (92207, "GCVS type RCB, V 8.3"),
    ],
    ids=["omicron Cet", "Algol", "delta Cep", "V CrA"],
)
def test_a_variables_card(hip, said):
    """The GCVS's own lines of them; V CrA's minimum is only known to be below 16.5."""
    stars = sky_tables().stars
    mark = replace(mark_of("Alnilam")[0], row=stars.hip.tolist().index(hip))
    assert facts(sky_tables(), mark, fake_solution(600, 400), AngleStyle.SEXAGESIMAL, None)["Variable"] == said
    assert "Variable" not in facts(
        sky_tables(), mark_of("Alnitak")[0], fake_solution(600, 400), AngleStyle.DECIMAL, None
    )


def test_a_planets_card_tells_where_it_was():
    told = facts(sky_tables(), jupiter_at(9.0, 9.0), fake_solution(600, 400), AngleStyle.SEXAGESIMAL, None)
    assert "Uncertainty (1σ)" not in told
    assert (told[""], told["Magnitude"], told["Diameter"], told["Distance"]) == ("Planet", "-2.5", "46.1″", "4.2 au")
    assert told["RA, Dec"].startswith("05h 36m")


def test_a_satellites_card_has_kilometres_and_its_uncertainty():
    jupiter = jupiter_at(9.0, 9.0)
    iss = replace(jupiter.body, kind=BodyKind.SPACECRAFT, distance_au=6e-6, magnitude=np.nan, sigma_arcsec=900.0)
    mark = replace(jupiter, kind="satellite", body=iss)
    told = facts(sky_tables(), mark, fake_solution(600, 400), AngleStyle.SEXAGESIMAL, None)
    assert (told[""], told["Distance"], told["Uncertainty (1σ)"]) == ("Satellite", "898 km", "900.0″")
    assert "Magnitude" not in told


@pytest.mark.parametrize("place", sorted(PLACES))
@pytest.mark.parametrize(("ra", "dec"), [(84.0, -1.2), (10.7, 41.3), (200.0, -62.0), (37.9, 89.3)])
def test_nothing_is_higher_at_any_time_of_the_day_than_at_its_best(place, ra, dec):
    vector = unit_vectors(ra, dec)
    horizon = Horizon(PLACES[place], EVENING, Refraction(pressure_hpa=0.0))
    times = (EVENING + timedelta(minutes=5 * k) for k in range(288))
    highest = max(Horizon(PLACES[place], when, horizon.refraction).altaz_deg(vector)[0] for when in times)
    _, best = heights(vector, horizon)
    assert (best == "never rises") == (highest < 0.0)
    assert highest < 0.0 or float(best.split("°")[0]) == pytest.approx(highest, abs=0.6)


def test_the_smallest_thing_under_the_cursor_is_meant(qtbot):
    overlay = Overlay(tables=sky_tables())
    overlay.show(np.empty((0, 2)), fake_solution(600, 400))
    painted(overlay)
    flame, star = mark_of("NGC 2024")[0], mark_of("Alnitak")[0]
    assert overlay.mark_at(*flame.xy, 5.0).short == "NGC 2024"
    assert overlay.mark_at(*star.xy, 5.0).short == "Alnitak"
    overlay.layers.on["names"] = False
    painted(overlay)
    assert getattr(overlay.mark_at(*star.xy, 5.0), "kind", "") != "star"
