"""A pointing model: how far a mount is off everywhere, from frames solved in several places.

The terms are those of :mod:`kochab.pointing.disagreement`: offsets of both axes, lean of the first axis (2), cone.
What a mount adds to declination after a sync may be an offset of declination or of its axis' angle, which is the other
way on the other side of the pier: sightings from both sides tell.
"""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from math import cos, hypot, radians, sqrt

import numpy as np

from kochab.core.attitude import Degrees, apart_deg, radec_deg, unit_vectors
from kochab.core.errors import RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Epoch
from kochab.core.values import frozen
from kochab.pointing.disagreement import (
    AXES,
    BUILT,
    CONES,
    NARROW,
    OFFSETS,
    SET_UP,
    SMALL,
    Cause,
    MountSighting,
    Seen,
    axes_of,
    fit,
    residuals,
    turned,
)
from kochab.sky.horizon import sidereal_deg
from kochab.text.translation import tr, tr_n, tr_noop

FEWEST = 4  # sightings: eight numbers for five terms
FARTHEST_DEG = 5.0  # beyond, a mount is to be aligned or synced
FLOOR_DEG = 15.0 / 3600.0  # what mounts round to
NAMES = {
    False: (
        tr_noop("right ascension's offset"),
        tr_noop("declination's offset"),
        tr_noop("polar axis to the west"),
        tr_noop("polar axis too high"),
        tr_noop("cone"),
    ),
    True: (
        tr_noop("azimuth"),
        tr_noop("altitude"),
        tr_noop("base to the west"),
        tr_noop("base to the south"),
        tr_noop("cone"),
    ),
}


@frozen
class PointingModel:
    """What a mount says too much, with one sigma: five terms in degrees, by :func:`fit_model`.

    ``reverses``: the second axis' offset changes its sign with the side of the pier.
    ``before_arcsec`` and ``after_arcsec`` are root mean squares of the sightings it was made from, ``foretold_arcsec``
    that of each by a model made from the others: what a goto can hope for.
    """

    terms_deg: tuple[float, ...]
    sigmas_deg: tuple[float, ...]
    alt_azimuth: bool
    site: Site
    epoch: Epoch
    sightings: int
    made_utc: datetime
    before_arcsec: float
    after_arcsec: float
    foretold_arcsec: float
    reverses: bool = False

    @property
    def helps(self) -> bool:
        """Whether it foretells places better than the mount does alone."""
        return self.foretold_arcsec < self.before_arcsec

    def rows(self) -> list[tuple[str, str]]:
        """Each term's name, and its value with its sigma."""
        south = -1.0 if self.site.latitude_deg < 0.0 and not self.alt_azimuth else 1.0  # of the other pole
        signs = (1.0, 1.0, south, south, 1.0)
        terms = (sign * term for sign, term in zip(signs, self.terms_deg, strict=True))
        named = zip(NAMES[self.alt_azimuth], terms, self.sigmas_deg, strict=True)
        return [(tr(name), f"{60.0 * term:+.2f}′ ± {60.0 * sigma:.2f}′") for name, term, sigma in named]

    def worth(self) -> str:
        """What a goto gains by it."""
        worth = tr_n(
            "{n} sighting is off by {before:.1f}′, with the model by {after:.1f}′; a new place by about {new:.1f}′.",
            "{n} sightings are off by {before:.1f}′, with the model by {after:.1f}′; a new place by about {new:.1f}′.",
            self.sightings,
            before=self.before_arcsec / 60.0,
            after=self.after_arcsec / 60.0,
            new=self.foretold_arcsec / 60.0,
        )
        if not self.helps:
            return tr("{worth} It does not help: sync the mount instead.", worth=worth)
        return worth

    def lines(self) -> list[str]:
        """Each term with its sigma, and what the model is worth."""
        return [*(f"{name:22} {value:>16}" for name, value in self.rows()), self.worth()]

    def aim(self, place_deg: Degrees, time_utc: datetime) -> Degrees:
        """Where to send the mount, in its own coordinates, so that it points at ``place_deg``, in the same.

        Raises `RefusedError` when that is farther than five degrees away, or beyond a pole.
        """
        reported = reported_at(self, place_deg, sidereal_deg(self.site, time_utc))
        away = apart_deg(reported, place_deg)
        # so that a NaN is refused, too
        if not away <= FARTHEST_DEG:
            raise RefusedError(
                "The pointing model would shift this goto by {away:.1f}°, more than {farthest:g}°.",
                away=away,
                farthest=FARTHEST_DEG,
            )
        return reported


def reported_at(model: PointingModel, place_deg: Degrees, sidereal: float) -> Degrees:
    """What the mount says when it points at a place, at this local sidereal time, degrees."""
    terms, axes = np.asarray(model.terms_deg), axes_of(model.site, model.alt_azimuth)
    there = unit_vectors(place_deg[0] - sidereal, place_deg[1]) @ axes
    lon, lat = radec_deg(turned(there, terms))
    # the side a mount that flips at the meridian takes there
    west = (sidereal - place_deg[0]) % 360.0 < 180.0
    side = 1.0 if model.alt_azimuth or west else -1.0
    cone = side * terms[4] / max(cos(radians(lat)), NARROW)
    second = terms[1] * (side if model.reverses else 1.0)
    ra, dec = radec_deg(unit_vectors(lon + terms[0] + cone, lat + second) @ axes.T)
    return (ra + sidereal) % 360.0, dec


def fit_model(sightings: Sequence[MountSighting]) -> PointingModel:
    """The terms of a mount from four sightings or more; `RefusedError` says what is missing."""
    if len(sightings) < FEWEST:
        raise RefusedError(
            "A pointing model needs {fewest} sightings far from each other, not {sightings}.",
            fewest=FEWEST,
            sightings=len(sightings),
        )
    site = sightings[-1].site
    if site is None or any(sighting.site is None for sighting in sightings):
        raise RefusedError("A pointing model needs the site: set it first.")
    alt_azimuth = bool(sightings[-1].alt_azimuth)
    seen = Seen(sightings)
    fits = [(fit(seen, cause), cause) for cause in free_causes(alt_azimuth)]
    (_, terms, left), cause = max(fits, key=lambda one: one[0][0])
    slopes = residuals(terms, *cause.geometry(seen))[1].reshape(-1, 5)
    # two numbers a sighting, less five terms
    freedom = max(1, left.size - 5)
    noise = max(float(np.sqrt((left**2).sum() / freedom)), FLOOR_DEG)
    # the widest priors bound terms that the sightings leave open, as the cone seen from one side
    covariance = np.linalg.inv(slopes.T @ slopes / noise**2 + np.diag(cause.scales().max(axis=0) ** -2.0))
    foretold = [_foretold(sightings, k, cause) for k in range(len(sightings))]
    before = [apart_deg(e, s) for e, s in zip(seen.expected, seen.reported, strict=True)]
    return PointingModel(
        tuple(map(float, terms)),
        tuple(map(float, np.sqrt(np.diag(covariance)))),
        alt_azimuth,
        site,
        sightings[-1].reported.epoch,
        len(sightings),
        sightings[-1].time_utc,
        3600.0 * _rms(before),
        3600.0 * _rms([hypot(*row) for row in left]),
        3600.0 * _rms(foretold),
        cause.reverses,
    )


def free_causes(alt_azimuth: bool) -> Sequence[Cause]:
    """All terms free; the second axis' offset one of declination, or of the axis itself."""
    offset, axis, cone = (*SMALL, *OFFSETS), (*SET_UP, *AXES), (*BUILT, *CONES)
    free = Cause("", "", lambda seen: seen.expected, 1.0, offset=offset, axis=axis, cone=cone, fitted=True)
    return [replace(free, alt_azimuth=True)] if alt_azimuth else [free, replace(free, reverses=True)]


def _foretold(sightings: Sequence[MountSighting], k: int, cause: Cause) -> float:
    """How far off, degrees, sighting ``k`` is by a model made from the others."""
    _, terms, _ = fit(Seen([s for j, s in enumerate(sightings) if j != k]), cause)
    off, _ = residuals(terms, *cause.geometry(Seen([sightings[k]])))
    return float(np.hypot(*off[0]))


def _rms(values: Sequence[float]) -> float:
    return sqrt(sum(value**2 for value in values) / len(values))
