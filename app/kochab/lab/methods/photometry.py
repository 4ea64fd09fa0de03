"""How bright a star looks to a sensor that is not the eye: the B-V colour term.

The 1992 paper (section "Correction to CCD-Sensitivity") takes each star for a black body and
integrates it over the sensor's response instead of the visual one. Over the range of star colours
that is close to a line in B-V, which is what a person can calibrate: ``m = V + c (B-V)``.
"""

import numpy as np
from numpy.typing import ArrayLike

from kochab.core.arrays import Floats

TYPICAL_BV = 0.7  # the median over stars of the catalogue whose colour is known
VISUAL_NM = (480.0, 650.0)  # the paper's interval of V
SECOND_RADIATION_NM_K = 1.438777e7  # hc/k


def sensor_magnitude(v: ArrayLike, bv: ArrayLike, colour_term: float) -> Floats:
    """Magnitudes (N,) as a sensor sees them: ``v + colour_term (bv - 0)``, zero for B-V = 0.

    Stars of unknown colour (NaN) count as the typical 0.7. A red-sensitive sensor has a negative
    term: red stars look brighter to it than to the eye.
    """
    colour = np.asarray(bv, dtype=np.float64)
    colour = np.where(np.isnan(colour), TYPICAL_BV, colour)
    return np.asarray(np.asarray(v, dtype=np.float64) + colour_term * colour)


def temperature_k(bv: ArrayLike) -> Floats:
    """Effective temperatures (N,) of colours B-V, by Ballesteros (2012, EPL 97, 34008, eq. 14)."""
    colour = np.asarray(bv, dtype=np.float64)
    return np.asarray(4600.0 * (1.0 / (0.92 * colour + 1.7) + 1.0 / (0.92 * colour + 0.62)))


def colour_term(wavelength_nm: ArrayLike, response: ArrayLike) -> float:
    """The colour term of a sensor from its response (W,) at ascending wavelengths (W,) in nm.

    Black bodies of B-V 0 to 1.5 are integrated over the response and over V as the paper states
    it; the term is the slope of the line fitted to the difference. ``response`` is per unit of
    energy and its scale does not matter.
    """
    wave = np.asarray(wavelength_nm, dtype=np.float64)
    sensor = np.asarray(response, dtype=np.float64)
    visual = ((wave >= VISUAL_NM[0]) & (wave <= VISUAL_NM[1])).astype(np.float64)
    if wave.ndim != 1 or sensor.shape != wave.shape or visual.sum() < 2 or sensor.max() <= 0:
        raise ValueError("a response needs wavelengths in nm that span 480 to 650")
    bv = np.linspace(0.0, 1.5, 31)
    exponent = SECOND_RADIATION_NM_K / (wave * temperature_k(bv)[:, None])
    planck = wave**-5.0 / np.expm1(exponent)
    ratio = _integral(planck * sensor, wave) / _integral(planck * visual, wave)
    return float(np.polyfit(bv, -2.5 * np.log10(ratio), 1)[0])


def _integral(values: Floats, wave: Floats) -> Floats:
    steps = np.diff(wave)
    return np.asarray(((values[:, 1:] + values[:, :-1]) * steps).sum(axis=1) / 2.0)


def vignetted(magnitude: ArrayLike, off_axis_rad: ArrayLike, power: float = 4.0) -> Floats:
    """Magnitudes (N,) dimmed by the lens towards the rim: flux falls as cos(angle)**power.

    The paper asks for this correction without giving a law; cos^4 is that of a simple lens.
    """
    cosine = np.maximum(np.cos(np.asarray(off_axis_rad, dtype=np.float64)), 1e-6)
    return np.asarray(np.asarray(magnitude, dtype=np.float64) - 2.5 * power * np.log10(cosine))
