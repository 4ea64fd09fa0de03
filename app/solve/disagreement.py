"""The disagreement detective: why the mount says one thing and the sky another.

Every cause, if it were the only one, would make the mount say a certain thing of the place the sky
shows. Causes are weighed by how near that comes to what it does say, against the chance that some
unknown offset comes as near; a mount that tells its own clock and site is a witness besides.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from math import exp, inf, log, pi

from app.core.attitude import apart_deg
from app.core.hint import Site
from app.core.mount import PierSide, Pointing
from app.mounts.beliefs import Beliefs
from app.mounts.epoch import to_mount_epoch

Degrees = tuple[float, float]

AGREE_ARCSEC = 120.0  # a mount's own rounding, and what mechanics leave
LOOSE_DEG = 0.6  # how well a roughly set up mount points once the cause is allowed for
TIGHT_DEG = 2.0 / 60.0  # where the mount was well aligned, but in another epoch
NAMED = 0.8
UNKNOWN = 0.3  # weight of "something else"
FAR_DEG = 5.0  # how large offsets without one of these causes usually are


@dataclass(frozen=True, slots=True)
class Sighting:
    """One solved frame, and what the mount said when it was taken.

    ``sky_deg`` is ICRS; ``time_utc`` and ``site`` are the computer's.
    """

    sky_deg: Degrees
    said: Pointing
    time_utc: datetime
    site: Site | None = None
    pier_side: PierSide | None = None
    aligned: bool | None = None
    beliefs: Beliefs = field(default_factory=Beliefs)

    @property
    def expected_deg(self) -> Degrees:
        """What a mount without fault would say, in its own epoch."""
        return to_mount_epoch(*self.sky_deg, self.said.epoch, self.time_utc)

    @property
    def said_deg(self) -> Degrees:
        """RA and Dec the mount said."""
        return self.said.ra_deg, self.said.dec_deg


@dataclass(frozen=True, slots=True)
class Cause:
    """A hypothesis: what the mount would say of each sighting if only this were wrong.

    ``weight`` is how often that happens before anything is known; ``spread_deg`` how near a mount
    comes to it; ``freedom`` how many numbers were fitted to the sightings. ``witness`` multiplies
    the weight by what the mount tells of its clock and site.
    """

    name: str
    advice: str
    would_say: tuple[Degrees, ...]
    weight: float
    spread_deg: float = LOOSE_DEG
    freedom: int = 0
    witness: float = 1.0
    evidence: str = ""


@dataclass(frozen=True, slots=True)
class Suspect:
    """A cause with its score in 0..1 and what it leaves unexplained."""

    name: str
    score: float
    residual_arcsec: float
    evidence: str
    advice: str


@dataclass(frozen=True, slots=True)
class Finding:
    """The verdict: ``cause`` is empty when no single cause explains it or nothing is wrong."""

    agrees: bool
    cause: str
    sentence: str
    offset_arcsec: float
    east_arcsec: float
    north_arcsec: float
    suspects: tuple[Suspect, ...]


def investigate(sightings: Sequence[Sighting]) -> Finding:
    """Name the cause of the disagreement, or say that no single one explains it.

    More sightings, on both sides of the meridian above all, tell more. At least one is needed.
    """
    from app.solve.disagreement_causes import causes

    suspects = weighed(sightings, causes(sightings))
    last = sightings[-1]
    offset = max(apart_deg(s.expected_deg, s.said_deg) for s in sightings) * 3600.0
    east, north = _parts_arcsec(last)
    agrees = offset <= AGREE_ARCSEC
    best = suspects[0] if suspects else None
    named = best is not None and best.score >= NAMED and not agrees
    if agrees:
        sentence = f"Mount and sky agree within {_angle(offset)}."
    elif best is not None and named:
        sentence = f"{best.name}: {best.evidence} {best.advice}"
    else:
        sentence = (
            f"Mount and sky are {_angle(offset)} apart, and no single cause explains it: align the "
            "mount or sync it on a solved frame, and look again somewhere else."
        )
    cause = best.name if best is not None and named else ""
    return Finding(agrees, cause, sentence, offset, east, north, tuple(suspects))


def weighed(sightings: Sequence[Sighting], causes: Sequence[Cause]) -> list[Suspect]:
    """Each cause's share of the probability, likeliest first; what is left is for no cause."""
    said = [s.said_deg for s in sightings]
    offsets = [apart_deg(s.expected_deg, s.said_deg) for s in sightings]
    nothing = log(UNKNOWN) + sum(_unknown(offset) for offset in offsets)
    logs = [_support(cause, said) for cause in causes]
    top = max([nothing, *logs])
    total = sum(exp(x - top) for x in [nothing, *logs])
    found = [
        Suspect(c.name, exp(x - top) / total, _worst_arcsec(c, said), _evidence(c, said), c.advice)
        for c, x in zip(causes, logs, strict=True)
    ]
    return sorted(found, key=lambda s: -s.score)


def _support(cause: Cause, said: Sequence[Degrees]) -> float:
    """Logarithm of weight times likelihood; a fitted number costs as much as it could gain."""
    if not cause.would_say or cause.weight * cause.witness <= 0.0:
        return -inf
    fit = sum(
        _near(apart_deg(would, does), cause.spread_deg)
        for would, does in zip(cause.would_say, said, strict=True)
    )
    return log(cause.weight * cause.witness) + fit - cause.freedom * log(FAR_DEG / cause.spread_deg)


def _near(residual_deg: float, spread_deg: float) -> float:
    """Log density on the sky, per square degree, of a residual."""
    return -0.5 * (residual_deg / spread_deg) ** 2 - log(2.0 * pi * spread_deg**2)


def _unknown(offset_deg: float) -> float:
    """Log density of an offset without a cause: mostly some degrees, sometimes anything."""
    r = max(offset_deg, TIGHT_DEG)
    near = exp(-r / FAR_DEG) / (2.0 * pi * r * FAR_DEG)
    return log(0.9 * near + 0.1 / 41253.0)


def _worst_arcsec(cause: Cause, said: Sequence[Degrees]) -> float:
    pairs = zip(cause.would_say, said, strict=True)
    return max(apart_deg(would, does) for would, does in pairs) * 3600.0


def _evidence(cause: Cause, said: Sequence[Degrees]) -> str:
    left = _angle(_worst_arcsec(cause, said))
    return f"{cause.evidence} It leaves {left} unexplained."


def _parts_arcsec(s: Sighting) -> tuple[float, float]:
    """From what the mount says to where the sky is, towards east and north."""
    from math import cos, radians

    from app.mounts.sky_frame import wrapped

    there, said = s.expected_deg, s.said_deg
    east = wrapped(there[0] - said[0]) * cos(radians(there[1]))
    return east * 3600.0, (there[1] - said[1]) * 3600.0


def _angle(arcsec: float) -> str:
    if arcsec < 100.0:
        return f"{arcsec:.0f} arcsec"
    return f"{arcsec / 60.0:.1f} arcmin" if arcsec < 6000.0 else f"{arcsec / 3600.0:.1f} deg"
