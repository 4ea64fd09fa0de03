"""How far an axis is from its pole, how surely, in numbers and in words."""

import math
import re
from dataclasses import field
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, angle_between
from kochab.core.errors import UsageError
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.core.values import frozen
from kochab.polar.rotations import alt_az, wrapped_rad
from kochab.text.translation import number, tr, tr_n, tr_noop

CHI2_68, CHI2_95 = 2.2957, 5.9915  # two degrees of freedom, probabilities 0.6827 and 0.95


class Knob(StrEnum):
    """The two ways a polar axis is moved."""

    ALTITUDE = "altitude"
    AZIMUTH = "azimuth"


@frozen(eq=False)
class PolarError:
    """An axis against its pole, both unit vectors (3,) in E, N, U.

    ``covariance`` (2, 2), rad^2, is of the axis along (altitude, azimuth on the sky), from the
    frames' own errors. Altitude is positive when the axis is too high, azimuth when it stands too
    far clockwise, seen from above. ``flexure`` (2, 2), rad^2, comes on top: what the frames could
    not show, such as a tube that sags; ``creep`` (2, 2), rad^2, is of what may have moved meanwhile without showing.
    Whatever is shown after a ± is of :attr:`with_systematics`.
    """

    axis: Floats
    pole: Floats
    covariance: Floats
    flexure: Floats = field(default_factory=lambda: np.zeros((2, 2)))
    creep: Floats = field(default_factory=lambda: np.zeros((2, 2)))

    @property
    def altitude_arcsec(self) -> float:
        """Altitude of the axis less that of the pole."""
        return (alt_az(self.axis)[0] - alt_az(self.pole)[0]) / ARCSEC

    @property
    def azimuth_arcsec(self) -> float:
        """Azimuth of the axis less that of the pole: what the azimuth knob has to turn."""
        return wrapped_rad(alt_az(self.axis)[1] - alt_az(self.pole)[1]) / ARCSEC

    @property
    def azimuth_on_sky_arcsec(self) -> float:
        """The share of the azimuth error in the total: shorter by the cosine of the altitude."""
        return self.azimuth_arcsec * float(np.cos(alt_az(self.axis)[0]))

    @property
    def total_arcsec(self) -> float:
        """The angle between axis and pole."""
        return angle_between(self.axis, self.pole) / ARCSEC

    @property
    def sigma_arcsec(self) -> tuple[float, float]:
        """One-sigma errors along altitude and along azimuth on the sky."""
        alt, az = np.sqrt(np.diag(self.covariance)) / ARCSEC
        return float(alt), float(az)

    @property
    def sigma_azimuth_arcsec(self) -> float:
        """One-sigma error of the knob's azimuth, not shortened."""
        return self.sigma_arcsec[1] / max(float(np.cos(alt_az(self.axis)[0])), 1e-6)

    def knob_arcsec(self, knob: Knob) -> float:
        """What a knob has to take away: altitude, or azimuth as the knob turns."""
        return self.altitude_arcsec if knob is Knob.ALTITUDE else self.azimuth_arcsec

    def knob_sigma_arcsec(self, knob: Knob) -> float:
        """One-sigma error of the same."""
        return self.sigma_arcsec[0] if knob is Knob.ALTITUDE else self.sigma_azimuth_arcsec

    @property
    def uncertainty_arcsec(self) -> float:
        """Root mean square distance of the measured from the true axis, without flexure."""
        return float(np.sqrt(np.trace(self.covariance))) / ARCSEC

    @property
    def flexure_arcsec(self) -> tuple[float, float]:
        """One-sigma flexure, along altitude and azimuth on the sky."""
        alt, az = np.sqrt(np.maximum(np.diag(self.flexure), 0.0)) / ARCSEC
        return float(alt), float(az)

    @property
    def creep_total_arcsec(self) -> float:
        """Root mean square distance by creep, both directions."""
        return float(np.sqrt(np.trace(self.creep))) / ARCSEC

    @property
    def flexure_total_arcsec(self) -> float:
        """Root mean square distance by flexure, both directions."""
        return float(np.hypot(*self.flexure_arcsec))

    @property
    def with_systematics(self) -> "PolarError":
        """The same with flexure and creep added to its covariance."""
        return PolarError(self.axis, self.pole, self.covariance + self.flexure + self.creep)

    @property
    def sigma_total_arcsec(self) -> float:
        """One-sigma error of the total, along the line from pole to axis."""
        line = np.array([self.altitude_arcsec, self.azimuth_on_sky_arcsec])
        length = float(np.linalg.norm(line))
        if length < 1e-9:
            return self.uncertainty_arcsec / float(np.sqrt(2.0))
        along = line / length
        return float(np.sqrt(along @ self.covariance @ along) / ARCSEC)

    @property
    def flexure_along_arcsec(self) -> float:
        """The share of flexure and creep in ``with_systematics.sigma_total_arcsec``."""
        both, noise = self.with_systematics.sigma_total_arcsec, self.sigma_total_arcsec
        return float(np.sqrt(max(both**2 - noise**2, 0.0)))

    @property
    def below_uncertainty(self) -> bool:
        """Whether the error could be zero: the pole is inside the 68 % ellipse."""
        return self.distance2(self.pole) <= CHI2_68

    def distance2(self, truth: Floats) -> float:
        """Squared Mahalanobis distance of a direction (3,) from the axis; chi-square of two."""
        alt, az = alt_az(truth)
        own_alt, own_az = alt_az(self.axis)
        gap = np.array([alt - own_alt, wrapped_rad(az - own_az) * np.cos(own_alt)])
        return float(gap @ np.linalg.solve(self.covariance, gap))

    def ellipse_arcsec(self, probability: float = 0.6827) -> tuple[float, float, float]:
        """Semi-axes (long, short), arcsec, and the long one's angle from azimuth to altitude, rad.

        The true axis is inside with the given probability.
        """
        scale = np.sqrt(-2.0 * np.log1p(-probability)) / ARCSEC  # two degrees of freedom: p = 1 - exp(-chi2 / 2)
        values, vectors = np.linalg.eigh(self.covariance)
        short, long = np.sqrt(np.maximum(values, 0.0)) * scale  # eigh gives the smaller value first
        return float(long), float(short), float(np.arctan2(vectors[0, 1], vectors[1, 1]))


# -- Good enough? What is left of the error does to the frames that a person wants to take --------

CORNER_MM, DECLINATION_DEG = 14.0, 60.0  # of an APS-C sensor, from the guide star; as far as most objects are
MOST_PX = 1.0


@frozen
class Imaging:
    """Focal length, mm, pixel, µm, and the seconds of one exposure."""

    focal_mm: float
    pixel_um: float
    exposure_s: float

    @classmethod
    def parse(cls, text: str) -> "Imaging":
        """From three numbers: ``600 mm, 3.76 µm, 300 s``; raises UsageError."""
        numbers = [float(n) for n in re.findall(r"\d+(?:\.\d+)?", text)]
        if len(numbers) != 3 or min(numbers) <= 0.0:
            raise UsageError("{text} is not focal length, pixel and exposure, as in 600 mm, 3.76 µm, 300 s.", text=text)
        return cls(*numbers)

    @property
    def trail_px_arcsec(self) -> float:
        """Pixels of trail an arcsec of error, at worst, when nobody guides: the sky turns about another pole."""
        return SIDEREAL_RAD_S * self.exposure_s * ARCSEC * self.focal_mm * 1000.0 / self.pixel_um

    @property
    def rotation_px_arcsec(self) -> float:
        """Pixels that the frame's corner turns about the guide star an arcsec of error, at worst."""
        faster = 1.0 / math.cos(math.radians(DECLINATION_DEG))
        return SIDEREAL_RAD_S * self.exposure_s * ARCSEC * faster * CORNER_MM * 1000.0 / self.pixel_um

    @property
    def unguided_arcsec(self) -> float:
        """The error that trails no star by more than a pixel when nobody guides."""
        return MOST_PX / self.trail_px_arcsec

    @property
    def guided_arcsec(self) -> float:
        """The error that turns the frame's corner by no more than a pixel about the guide star."""
        return MOST_PX / self.rotation_px_arcsec


def good_enough(error: PolarError, imaging: Imaging) -> str:
    """How small an error is enough for such frames: it moves no star by more than a pixel."""
    trail, rotation = (error.total_arcsec * each for each in (imaging.trail_px_arcsec, imaging.rotation_px_arcsec))
    alone, guided = (limit_in_words(each) for each in (imaging.unguided_arcsec, imaging.guided_arcsec))
    if trail <= MOST_PX:
        return tr("Good enough: stop.")
    if rotation <= MOST_PX:
        return tr("Good enough if you guide. Unguided: {alone}.", alone=alone)
    return tr("Guided: {guided} is enough. Unguided: {alone}.", guided=guided, alone=alone)


def limit_in_words(arcsec: float) -> str:
    """What is enough, from ten arcminutes on in whole ones."""
    return f"{int(arcsec / 60.0)}′" if 600.0 <= arcsec < 5400.0 else angle_in_words(arcsec)


# -- Polar errors and bolt turns in words that hold from every side of the mount ---------------

# Whole phrases: a translator can't reorder what is glued from halves.
EIGHTHS = (
    ("", ""),
    (tr_noop("an eighth of a turn"), tr_noop("{turns} and an eighth turns")),
    (tr_noop("a quarter turn"), tr_noop("{turns} and a quarter turns")),
    (tr_noop("three eighths of a turn"), tr_noop("{turns} and three eighths turns")),
    (tr_noop("half a turn"), tr_noop("{turns} and a half turns")),
    (tr_noop("five eighths of a turn"), tr_noop("{turns} and five eighths turns")),
    (tr_noop("three quarters of a turn"), tr_noop("{turns} and three quarters turns")),
    (tr_noop("seven eighths of a turn"), tr_noop("{turns} and seven eighths turns")),
)
NUMBERS = (
    *(tr_noop("no"), tr_noop("one"), tr_noop("two"), tr_noop("three"), tr_noop("four"), tr_noop("five")),
    *(tr_noop("six"), tr_noop("seven"), tr_noop("eight"), tr_noop("nine"), tr_noop("ten")),
)

FINEST_DEG = 2.0  # a hand cannot turn a bolt by less


def sayable(turns: float, to_the_degree: bool = False) -> float:
    """The amount of turns nearest to zero of ``turns`` that words can say: eighths, or degrees.

    ``to_the_degree`` below an eighth of a turn: the nearest step of the finest that a hand can turn by.
    """
    size = abs(turns)
    if to_the_degree and size < 0.125:
        return math.copysign(round(size * 360.0 / FINEST_DEG) * FINEST_DEG / 360.0, turns)
    # eighths from 45°, steps of 5° from 15°, then of 2°; 1e-9 for what floating point leaves just short of a whole step
    steps = 8.0 if size >= 0.125 else 360.0 / (5.0 if size >= 1 / 24 else FINEST_DEG)
    return math.copysign(math.floor(size * steps + 1e-9) / steps, turns)


def turns_in_words(turns: float) -> str:
    """``"a quarter turn"`` for 0.25, ``"6°"`` for a sixtieth; without sign."""
    eighths = round(abs(turns) * 8.0)
    if abs(abs(turns) * 8.0 - eighths) > 1e-6 or eighths == 0:
        return f"{abs(turns) * 360.0:.0f}°"
    whole, rest = divmod(eighths, 8)
    if not whole:
        return tr(EIGHTHS[rest][0])
    count = tr(NUMBERS[whole]) if whole < len(NUMBERS) else str(whole)
    return tr(EIGHTHS[rest][1], turns=count) if rest else tr_n("{count} turn", "{count} turns", whole, count=count)


def rotation_in_words(turns: float) -> str:
    """Which way a bolt turns, looking at its head: positive is clockwise."""
    return tr("clockwise") if turns > 0 else tr("anticlockwise")


def angle_in_words(arcsec: float) -> str:
    """``45″``, ``12.5′`` or ``1.25°``, without sign."""
    size = abs(arcsec)
    if size < 99.5:  # more would be written as 100″
        return f"{size:.0f}″"
    return f"{number(size / 60.0, '.1f')}′" if size < 5400.0 else f"{number(size / 3600.0, '.2f')}°"


FINER = tr_noop("Finer than one sweep can tell (±{sigma}). Tighten, then check.")


def finer_in_words(error: PolarError) -> str:
    """That the error is within its uncertainty, and what to do then."""
    return tr(FINER, sigma=angle_in_words(error.with_systematics.sigma_total_arcsec))


def total_in_words(error: PolarError) -> str:
    """How far the axis is from the pole, with one sigma, flexure included."""
    return f"{angle_in_words(error.total_arcsec)} ± {angle_in_words(error.with_systematics.sigma_total_arcsec)}"


def split_in_words(error: PolarError) -> str:
    """What the ± of the total is made of; the squares of both add up to its own."""
    noise, flexure = angle_in_words(error.sigma_total_arcsec), angle_in_words(error.flexure_along_arcsec)
    return tr("{noise} measurement, {flexure} possible flexure", noise=noise, flexure=flexure)


class Cure(NamedTuple):
    """What takes an error away: in one word, as a sign, and as the way that holds from every side of the mount."""

    word: str
    sign: str
    way: str


CURES = {  # of a negative and of a positive error
    Knob.ALTITUDE: (Cure("raise", "▲", tr_noop("raise the axis")), Cure("lower", "▼", tr_noop("lower the axis"))),
    Knob.AZIMUTH: (
        Cure("clockwise", "▶", tr_noop("clockwise, seen from above")),
        Cure("anticlockwise", "◀", tr_noop("anticlockwise, seen from above")),
    ),
}


def cure(error: PolarError, knob: Knob) -> Cure:
    """Which way to turn."""
    found = CURES[knob][error.knob_arcsec(knob) > 0]
    return found._replace(way=tr(found.way))


def knob_in_words(error: PolarError, knob: Knob) -> str:
    """The error at a knob, without sign, with one sigma, flexure included."""
    sigma = error.with_systematics.knob_sigma_arcsec(knob)
    return f"{angle_in_words(error.knob_arcsec(knob))} ± {angle_in_words(sigma)}"


def altitude_in_words(error: PolarError) -> str:
    """What has to be done in altitude."""
    high = tr("{error} too high: lower the axis", error=knob_in_words(error, Knob.ALTITUDE))
    low = tr("{error} too low: raise the axis", error=knob_in_words(error, Knob.ALTITUDE))
    return high if error.altitude_arcsec > 0 else low


def azimuth_in_words(error: PolarError) -> str:
    """What has to be done in azimuth."""
    way = tr(cure(error, Knob.AZIMUTH).way)
    text = tr("{error} too far {side}: rotate the mount {way}")
    return text.format(error=knob_in_words(error, Knob.AZIMUTH), side=towards(error), way=way)


def offset_in_words(error: PolarError, knob: Knob) -> str:
    """Where the axis stands, and no word of what to do about it."""
    if knob is Knob.AZIMUTH:
        return tr("{error} too far {side}", error=knob_in_words(error, knob), side=towards(error))
    high, low = tr("{error} too high"), tr("{error} too low")
    return (high if error.altitude_arcsec > 0 else low).format(error=knob_in_words(error, knob))


def towards(error: PolarError) -> str:
    """East or west: where the axis stands beside the pole."""
    # by the east component: at the south pole azimuth runs the other way
    return tr("east") if error.axis[0] > error.pole[0] else tr("west")
