"""What a frame shows beside the stars of the catalogue, as columns of lists: streaks, bodies, unlisted sources."""

import math
from typing import Any

import pyarrow as pa

from kochab.core.progress import Task
from kochab.sky.elements import kept_elements
from kochab.workflows.night.crossings import Crossing
from kochab.workflows.night.frame import NightFrame, with_objects
from kochab.workflows.night.strangers import Sight
from kochab.workflows.solution_json import Json
from kochab.workflows.solve_frame import SolvedFrame

_F, _S = pa.float64(), pa.string()
_PLACE = [("ra_deg", _F), ("dec_deg", _F), ("sigma_arcsec", _F), ("mag", _F), ("sigma_mag", _F), ("x", _F), ("y", _F)]
_CALLED = [("kind", _S), ("name", _S), ("length_deg", _F), ("sigma_arcsec", _F), ("snr", _F)]
_ENDS = [(f"{name}{end}_deg", _F) for end in (1, 2) for name in ("ra", "dec")]
_OFF = [("off_east_arcsec", _F), ("off_north_arcsec", _F)]
COLUMNS = {
    "streaks": pa.list_(pa.struct([*_CALLED, *_ENDS, ("whole", pa.bool_())])),
    "bodies": pa.list_(pa.struct([("name", _S), ("kind", _S), *_PLACE, *_OFF])),
    "unlisted": pa.list_(pa.struct(_PLACE)),
}
"""ICRS degrees as measured; ``off`` is measured less predicted. Null where nobody looked, empty where nothing is."""


def objects_of(night: NightFrame, found: SolvedFrame) -> Task[Json]:
    """The columns of a frame; empty without a solution. Satellites are named by the elements that the worker has."""
    night = yield from with_objects(night, found, kept_elements())
    if night.sights is None:
        return {}
    return {
        "streaks": [_streak(one) for one in night.crossings],
        "bodies": [_place(one) | {"name": one.name, "kind": one.kind} | _off(one) for one in night.sights.bodies],
        "unlisted": [_place(one) for one in night.sights.unknown],
    }


def _streak(one: Crossing) -> Json:
    ends = dict(zip((name for name, _ in _ENDS), (value for end in one.ends_deg for value in end), strict=True))
    fields: Json = {"kind": str(one.kind), "name": one.name or None, "length_deg": one.length_deg, "whole": one.whole}
    return fields | ends | {"sigma_arcsec": _known(one.sigma_arcsec), "snr": _known(one.snr)}


def _place(one: Sight) -> Json:
    return {name: _known(getattr(one, name)) for name, _ in _PLACE}


def _off(one: Sight) -> Json:
    return {name: _known(value) for (name, _), value in zip(_OFF, one.off_arcsec, strict=True)}


def _known(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None
