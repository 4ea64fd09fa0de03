"""How good a list of stars is, when the truth is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.simulate.stars import FWHM_PER_SIGMA, Sensor, Sky

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Stars of one field: ``xy`` (N, 2) px; ``snr`` (N,) and ``bound_px`` (N,) of ``expected``."""

    xy: Floats
    snr: Floats
    bound_px: Floats
    fwhm_px: float
    clipped: NDArray[np.bool_]


def expected(xy: Floats, flux_e: Floats, fwhm_px: float, sky: Sky, sensor: Sensor,
             size: tuple[int, int]) -> Truth:  # fmt: skip
    """The best signal-to-noise and centroid error that any method can reach, star by star.

    A pixel i of a star of flux F and image p(x, y) (Gaussian, averaged over the pixel) expects
    ``F p_i`` electrons on a background b, so its variance is ``v_i = F p_i + b + r^2 + g^2 / 12``
    with reading noise r and the rounding of a unit of g electrons. Fisher's information on the
    place along x is ``I = sum_i (F dp_i/dx)^2 / v_i``; by symmetry it does not mix with that on
    flux and on y, so no unbiased estimate has a smaller variance than ``1 / I`` (Cramer and Rao).
    The information on the flux gives ``SNR = F sqrt(sum_i p_i^2 / v_i)`` in the same way.
    The bound returned is the RMS along one axis, the mean of both.
    """
    from scipy.special import ndtr

    s = fwhm_px / FWHM_PER_SIGMA
    half = int(np.ceil(5 * s)) + 1
    reach = np.arange(-half, half + 1)
    level = sky.level_e + ((xy + 0.5) / np.array(size) - 0.5) @ np.array(sky.gradient_e)
    snr, bound, top = np.empty(len(xy)), np.empty(len(xy)), np.empty(len(xy))
    for k in range(0, len(xy), 500):
        at, flux = xy[k : k + 500], flux_e[k : k + 500, None, None]
        edges = (reach - 0.5 - (at - np.rint(at))[:, :, None]) / s  # left edges, (n, 2, K)
        share = ndtr(edges + 1 / s) - ndtr(edges)
        slope = (np.exp(-0.5 * edges**2) - np.exp(-0.5 * (edges + 1 / s) ** 2)) / (
            np.sqrt(2 * np.pi) * s
        )
        image = share[:, 1, :, None] * share[:, 0, None, :]
        other = level[k : k + 500] + sensor.read_noise_e**2 + sensor.gain_e**2 / 12
        variance = flux * image + other[:, None, None]
        along_x = flux * share[:, 1, :, None] * slope[:, 0, None, :]
        along_y = flux * slope[:, 1, :, None] * share[:, 0, None, :]
        information = [(d**2 / variance).sum(axis=(1, 2)) for d in (along_x, along_y)]
        snr[k : k + 500] = np.sqrt(((flux * image) ** 2 / variance).sum(axis=(1, 2)))
        bound[k : k + 500] = np.sqrt(0.5 / information[0] + 0.5 / information[1])
        top[k : k + 500] = (flux * image).max(axis=(1, 2)) + level[k : k + 500]
    clipped = top / sensor.gain_e + sensor.bias >= 0.97 * sensor.saturation
    return Truth(xy, snr, bound, fwhm_px, clipped)


def score(found: Floats, truth: Truth, snr: float = 10.0) -> dict[str, float]:
    """Completeness at ``snr``, purity, and centroid RMS over the bound of places (M, 2) px.

    A star is found when a place lies within half a FWHM (at least a pixel) of it, and a place is
    true when a star of any brightness does. Centroids count for every found star above ``snr``
    that does not clip and has no neighbour within 4 FWHM; their mean square error is taken in
    units of each star's own bound.
    """
    from scipy.spatial import cKDTree

    if not len(found):
        return {"completeness": 0.0, "purity": float("nan"), "rms_over_bound": float("nan")}
    radius = max(1.0, 0.5 * truth.fwhm_px)
    tree = cKDTree(truth.xy)
    away, star = (np.asarray(part) for part in tree.query(found))
    to_found, which = (np.asarray(part) for part in cKDTree(found).query(truth.xy))
    seen = np.asarray(to_found <= radius)
    alone = np.asarray(tree.query(truth.xy, k=2)[0])[:, 1] > 4 * truth.fwhm_px
    judged = seen & alone & (truth.snr >= snr) & ~truth.clipped & (star[which] == range(len(seen)))
    error = (found[which[judged]] - truth.xy[judged]) / truth.bound_px[judged, None]
    return {
        "completeness": float(seen[truth.snr >= snr].mean()),
        "purity": float((away <= radius).mean()),
        "rms_over_bound": float(np.sqrt((error**2).mean())) if judged.any() else float("nan"),
    }
