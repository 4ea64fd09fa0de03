"""What programs read: the stars of a frame as JSON."""

import json

import numpy as np

from kochab.core.frame import Detections
from kochab.workflows.answers import detections_json


def test_each_detection_is_told_as_it_was_measured() -> None:
    """Every number differs from every other, so that none can stand in another's place."""
    some = Detections(
        width=640,
        height=480,
        xy=np.array([[12.5, 34.25], [600.125, 7.0]]),
        flux=np.array([9000.0, 800.0]),
        snr=np.array([55.0, 11.0]),
        fwhm_px=np.array([2.5, np.nan]),
        elongation=np.array([1.25, 1.5]),
        angle_rad=np.array([np.pi / 6.0, -np.pi / 4.0]),
        saturated=np.array([True, False]),
        blended=np.array([False, True]),
        background=101.5,
        noise=3.25,
    )
    told = json.loads(json.dumps(detections_json(some), allow_nan=False))
    stars = told.pop("stars")
    assert told == {"width": 640, "height": 480, "background": 101.5, "noise": 3.25, "detections": 2}
    first = {"x": 12.5, "y": 34.25, "flux": 9000.0, "snr": 55.0, "fwhm_px": 2.5, "elongation": 1.25}
    second = {"x": 600.125, "y": 7.0, "flux": 800.0, "snr": 11.0, "fwhm_px": None, "elongation": 1.5}
    assert stars == [
        first | {"angle_deg": 30.0, "saturated": True, "blended": False},
        second | {"angle_deg": -45.0, "saturated": False, "blended": True},
    ]
