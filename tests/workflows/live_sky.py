"""Rendered frames of the real sky for the live tests, small and quick to solve."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.simulate.star_images import RenderedStar, Sensor, render
from kochab.sky import open_catalogue

START = datetime(2026, 3, 1, 22, 0, tzinfo=UTC)
CAMERA = Camera.centred(800, 600, 800 / 2 / np.tan(np.radians(6.0)))
"""12 degrees wide, 54 arcsec a pixel."""


def sky_frame(ra_deg=84.0, dec_deg=-2.0, roll_deg=20.0, seconds=0.0, seed=1, bayer=None):
    """A frame exposed 1 s around ``seconds`` after START."""
    attitude = attitude_from(ra_deg, dec_deg, roll_deg)
    catalogue = open_catalogue()
    rows = catalogue.brightest(attitude.boresight, np.radians(8.0), 400, 2026.2)
    xy = CAMERA.project(catalogue.vectors(rows, 2026.2) @ attitude.matrix.T)
    flux = 3e5 * 10 ** (-0.4 * (catalogue.mag(rows) - 4.0))
    frame = render(800, 600, xy, flux, RenderedStar(2.5), sensor=Sensor(bayer=bayer), seed=seed)
    hint = replace(frame.hint, time_utc=START + timedelta(seconds=seconds), exposure_s=1.0)
    return replace(frame, hint=hint)
