"""What a course makes of what it sees: pure numbers, no mount and no sky."""

from cmath import exp
from math import cos, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.workflows.centre_target import CentringEnd, end_of
from kochab.workflows.centring_corrections import Correction, Course, MountAndSky

TARGET = (100.0, 40.0)
NARROW = cos(radians(40.0))


def beside(east_arcsec, north_arcsec, place=TARGET):
    return place[0] + east_arcsec / 3600.0 / NARROW, place[1] + north_arcsec / 3600.0


def course(sky, said=TARGET, tolerance=10.0):
    found = Course(TARGET, tolerance)
    found.add(MountAndSky(said, sky), 0)
    return found


def test_the_way_fits_the_error() -> None:
    assert course(beside(9000.0, 0.0)).how(may_sync=True) is Correction.SYNC
    assert course(beside(9000.0, 0.0)).how(may_sync=False) is Correction.GOTO
    assert course(beside(-9000.0, 0.0)).how(may_sync=False) is Correction.APPROACH  # eastward
    assert course(beside(100.0, 100.0)).how(may_sync=True) is Correction.GOTO
    assert course(beside(40.0, 2.0)).how(may_sync=True) is Correction.FINE
    assert course(beside(2.0, 40.0)).how(may_sync=True) is Correction.GOTO  # play may swallow small moves


def test_a_declination_that_turns_back_is_approached_from_the_south() -> None:
    c = course(beside(0.0, -3000.0))
    assert c.command(False, False)[-1][1] > TARGET[1]  # northward
    c.add(MountAndSky(TARGET, beside(0.0, 100.0)), 1)
    assert c.how(False) is Correction.APPROACH
    first, there = c.command(False, True)
    assert first[1] < there[1]
    assert first[0] == pytest.approx(there[0])


def test_after_a_sync_the_mount_is_sent_to_the_target_itself() -> None:
    c = course(beside(5000.0, -3000.0), said=(101.0, 41.0))
    assert c.command(True, False) == [pytest.approx(TARGET)]


@given(st.floats(-6000, 6000), st.floats(-6000, 6000), st.floats(-2, 2), st.floats(-2, 2))
def test_without_a_sync_it_is_sent_as_far_beside(east, north, ra, dec) -> None:
    said = (TARGET[0] + ra, TARGET[1] + dec)
    c = course(beside(east, north), said)
    (there,) = c.command(False, False)
    assert there[0] == pytest.approx(said[0] - east / 3600.0 / NARROW)
    assert there[1] == pytest.approx(said[1] - north / 3600.0)


@given(st.floats(-0.3, 0.3), st.floats(0.8, 1.2), st.floats(-pi, pi))
def test_a_mount_turned_against_the_sky_is_right_at_the_second_correction(turn, share, way) -> None:
    """A command of z moves the sky by z times a fixed turn; two corrections end it."""
    turned = share * exp(1j * turn)
    sky, said = 2.0 * exp(1j * way), 0.0j
    c = Course(TARGET, 10.0)
    for k in range(3):
        c.add(MountAndSky(_place(said), _place(sky)), k)
        (there,) = c.command(False, False)
        command = complex((there[0] - TARGET[0]) * NARROW, there[1] - TARGET[1])
        sky, said = sky + (command - said) * turned, command
    assert abs(sky) * 3600.0 < 1e-3
    assert c.turn == pytest.approx(turned, abs=1e-6)
    assert c.slips == 0


def _place(z):
    return TARGET[0] + z.real / NARROW, TARGET[1] + z.imag


def test_a_clutch_that_gives_way_is_counted_as_slipping() -> None:
    c = course(beside(-9000.0, 0.0))
    for k in (1, 2):
        (there,) = c.command(False, False)
        c.add(MountAndSky(there, beside(-9000.0 + 900.0 * k, 0.0)), k)
    assert c.slips == 2
    assert end_of(c, "M 42", 2, 5)[0] is CentringEnd.SLIPPING


def test_a_correction_that_failed_is_another_look_and_teaches_nothing() -> None:
    c = course(beside(-9000.0, 0.0))
    for _ in range(4):
        c.command(False, False)
        c.add(MountAndSky(TARGET, beside(-9000.0, 0.0)), 0)
    assert len(c.errors_arcsec) == 1
    assert not c.no_better
    assert c.slips == 0
    assert c.turn == 1.0
    assert end_of(c, "M 42", 0, 5) is None


def test_after_a_goto_that_broke_off_the_whole_error_in_declination_is_sent() -> None:
    """What was synced far away says nothing about the backlash here: it took 23' of a first correction away."""
    c = course((80.0, -65.4), said=(85.0, -63.4))
    c.command(True, False)  # a sync, and the goto behind it loses its reply
    c.add(MountAndSky(TARGET, beside(-7000.0, 1400.0)), 0)
    assert c.command(False, True)[-1] == pytest.approx(beside(7000.0, -1400.0))


def test_guide_rates_are_learned_from_what_came_of_a_move() -> None:
    c = course(beside(-50.0, 0.0))
    east, _ = c.fine()
    assert east == pytest.approx(50.0 / NARROW)
    c.add(MountAndSky(TARGET, beside(50.0, 0.0)), 1)  # it went twice as far
    assert c.gain[0] == pytest.approx(2.0)
    east, _ = c.fine()
    assert east == pytest.approx(-25.0 / NARROW)


@pytest.mark.parametrize(("left_arcsec", "gain"), [(-48.0, 0.4), (49.0, 1.98), (95.0, 2.5), (4000.0, 2.5)])
def test_one_move_changes_the_guide_rate_by_two_and_a_half_at_most(left_arcsec, gain) -> None:
    """A gust, or a move that was lost: the next one must not be 50 times as long."""
    c = course(beside(-50.0, 0.0))
    c.fine()
    c.add(MountAndSky(TARGET, beside(left_arcsec, 0.0)), 1)
    assert c.gain == [pytest.approx(gain), 1.0]


def test_verdicts() -> None:
    done = end_of(course(beside(3.0, 4.0)), "M 42", 0, 5)
    assert done == (CentringEnd.CENTRED, "M 42 is centred to 5.0″.")
    assert end_of(course(beside(30.0, 40.0)), "M 42", 4, 5) is None
    end, sentence = end_of(course(beside(30.0, 40.0)), "M 42", 5, 5)
    assert end is CentringEnd.NOT_CONVERGING
    assert sentence == "Still 50.0″ off after 5 corrections; 10.0″ wanted."


def test_at_the_pole_numbers_stay_finite() -> None:
    c = Course((10.0, 90.0), 10.0)
    c.add(MountAndSky((50.0, 89.0), (200.0, 88.5)), 0)
    first, there = c.command(False, True)
    assert all(-90.0 <= place[1] <= 90.0 and 0.0 <= place[0] < 360.0 for place in (first, there))
