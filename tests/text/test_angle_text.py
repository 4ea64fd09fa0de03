import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.solution import NoSolution, Reason
from kochab.parsing.angles import parse_dec_deg, parse_ra_deg
from kochab.text.angle_text import (
    AngleStyle,
    angle_text,
    arcsec_text,
    dec_text,
    false_alarm_text,
    milliseconds_text,
    ra_text,
    radec_plain,
)
from kochab.workflows.solution_text import measured_rows

HMS, DMS, DECIMAL = AngleStyle


def test_orion_nebula_in_all_three():
    assert ra_text(83.82208, HMS) == "05h 35m 17.30s"
    assert dec_text(-5.39111, HMS) == "−05° 23′ 28.0″"
    assert ra_text(83.82208, DMS) == "083° 49′ 19.5″"
    assert ra_text(83.82208, DECIMAL) == "83.82208°"
    assert dec_text(-5.39111, DECIMAL) == "−5.39111°"


def test_sixty_seconds_are_never_shown():
    assert ra_text(15.0 - 1e-9, HMS) == "01h 00m 00.00s"
    assert ra_text(360.0 - 1e-9, HMS) == "00h 00m 00.00s"
    assert dec_text(-(1.0 - 1e-9), HMS) == "−01° 00′ 00.0″"


def test_a_small_negative_declination_keeps_its_sign():
    assert dec_text(-0.01, HMS).startswith("−00°")


@given(st.floats(0, 359.9999), st.floats(-90, 90))
def test_what_is_copied_can_be_typed_back(ra, dec):
    for style, tolerance in ((HMS, 1e-4), (DECIMAL, 1e-6)):
        text = radec_plain(ra, dec, style)
        assert text.isascii()
        a, b = text.split(" ")
        away = abs(parse_ra_deg(a) - ra)
        assert min(away, 360 - away) < tolerance
        assert abs(parse_dec_deg(b) - dec) < tolerance


@pytest.mark.parametrize(
    ("log10", "text"),
    [
        (-14.2, "1 in 10¹⁴"),
        (-7.2, "1 in 10⁷"),
        (-6.9, "1 in 1,000,000"),
        (-3.0, "1 in 1,000"),
        (-0.2, "more than 1 in 10"),
        (float("nan"), "not known"),
        (float("-inf"), "none to speak of"),
    ],
)
def test_false_alarm_in_words(log10, text):
    assert false_alarm_text(log10) == text


def test_sizes_choose_their_unit():
    assert angle_text(12.345) == "12.35°"
    assert angle_text(0.5) == "30.0′"
    assert angle_text(0.004) == "14.4″"
    assert arcsec_text(0.0512) == "0.051″"
    assert milliseconds_text(3.14) == "3.1 ms"
    assert milliseconds_text(1530) == "1.5 s"


def test_the_number_of_stars_is_told_once():
    failure = NoSolution(
        Reason.TOO_FEW_STARS, "Expose longer.", detections=4, measured={"stars_found": 4.0, "stars_expected": 61.0}
    )
    assert measured_rows(failure) == [("stars detected", "4"), ("stars expected", "61")]


def test_what_was_measured_has_its_unit_and_no_power_of_ten():
    measured = {
        "background_share": 0.9084,
        "saturated_share": 1.667e-5,
        "contrast_sigma": 3.107,
        "trail_px": 12.34,
        "scale_arcsec": 10345.6,
        "fwhm_px": 0.0,
    }
    failure = NoSolution(Reason.TOO_FEW_STARS, "Expose longer.", detections=0, measured=measured)
    assert measured_rows(failure)[1:] == [
        ("background", "90.8 %"),
        ("saturated", "0.00167 %"),
        ("contrast", "3.11 σ"),
        ("trail", "12.3 px"),
        ("scale", "10346″"),
        ("FWHM", "0 px"),
    ]
