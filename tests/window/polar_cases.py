"""Errors and states of an alignment, made by hand, for the tests of its screens."""

import numpy as np

from kochab.core.attitude import ARCSEC
from kochab.polar.error import PolarError
from kochab.polar.rotations import direction
from kochab.polar.tutor import BoltTutor
from kochab.workflows.session.alignment_state import AlignmentState

LATITUDE = np.radians(47.0)


def error(altitude_arcsec, azimuth_arcsec, sigma_arcsec=3.0):
    """An axis so far from a pole at 47 deg; azimuth as the knob turns."""
    axis = direction(LATITUDE + altitude_arcsec * ARCSEC, azimuth_arcsec * ARCSEC)
    spread = np.diag([1.0, 1.5]) * (sigma_arcsec * ARCSEC) ** 2
    return PolarError(axis, direction(LATITUDE, 0.0), spread)


def adjusting(altitude_arcsec, azimuth_arcsec, **more):
    """The state in which the tutor has just told what to turn."""
    off = error(altitude_arcsec, azimuth_arcsec)
    told = BoltTutor().advise(off)
    return AlignmentState("adjust", told.words, error=off, live=True, instruction=told, **more)
