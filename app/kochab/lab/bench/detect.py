"""``kochab bench detect``: speed, completeness, purity and centroids on rendered fields.

All detectors see the same frames in the same run, one after the other in turns, so that whatever else the machine
does falls on all alike. Medians over the turns of wall and of processor time are shown; the goals take processor
time, which other programs disturb less and which for a detector of one thread is the wall time of an idle machine.
The Cramer-Rao bound is derived in :func:`expected`.
"""

import contextlib
import time
import tracemalloc
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import ndtr

from kochab.core.arrays import Floats
from kochab.core.frame import Frame
from kochab.core.values import frozen
from kochab.detection import DETECTORS
from kochab.lab.bench import BenchResult, Goal, Report, Row, timed
from kochab.lab.detectors.star_finders import found_places
from kochab.simulate.star_images import FWHM_PER_SIGMA, RenderedStar, Sensor, Sky, render

# -- How good a list of stars is, when the truth is known --------------------------------------


@frozen(eq=False)
class DetectionTruth:
    """Stars of one field: ``xy`` (N, 2) px; ``snr`` (N,) and ``bound_px`` (N,) of ``expected``."""

    xy: Floats
    snr: Floats
    bound_px: Floats
    fwhm_px: float
    clipped: NDArray[np.bool_]


def expected(
    xy: Floats, flux_e: Floats, fwhm_px: float, sky: Sky, sensor: Sensor, size: tuple[int, int]
) -> DetectionTruth:
    """The best signal-to-noise and centroid error that any method can reach, star by star.

    A pixel i of a star of flux F and image p(x, y) (Gaussian, averaged over the pixel) expects ``F p_i`` electrons on
    a background b, so its variance is ``v_i = F p_i + b + r^2 + g^2 / 12`` with reading noise r and the rounding of a
    unit of g electrons. Fisher's information on the place along x is ``I = sum_i (F dp_i/dx)^2 / v_i``; by symmetry
    it does not mix with that on flux and on y, so no unbiased estimate has a smaller variance than ``1 / I`` (Cramer
    and Rao). The information on the flux gives ``SNR = F sqrt(sum_i p_i^2 / v_i)`` in the same way. The bound
    returned is the RMS along one axis, the mean of both.

    Parameters
    ----------
    xy : Floats
        Places of the stars (N, 2), px.
    flux_e : Floats
        Electrons of each (N,).
    fwhm_px : float
        Width of a star's image.
    sky : Sky
        Background.
    sensor : Sensor
        Gain and reading noise.
    size : tuple[int, int]
        Width and height of the frame, px.
    """
    s = fwhm_px / FWHM_PER_SIGMA
    half = int(np.ceil(5 * s)) + 1
    reach = np.arange(-half, half + 1)
    level = sky.level_e + ((xy + 0.5) / np.array(size) - 0.5) @ np.array(sky.gradient_e)
    snr, bound, top = np.empty(len(xy)), np.empty(len(xy)), np.empty(len(xy))
    for k in range(0, len(xy), 500):
        at, flux = xy[k : k + 500], flux_e[k : k + 500, None, None]
        edges = (reach - 0.5 - (at - np.rint(at))[:, :, None]) / s  # left edges, (n, 2, K)
        share = ndtr(edges + 1 / s) - ndtr(edges)
        slope = (np.exp(-0.5 * edges**2) - np.exp(-0.5 * (edges + 1 / s) ** 2)) / (np.sqrt(2 * np.pi) * s)
        image = share[:, 1, :, None] * share[:, 0, None, :]
        other = level[k : k + 500] + sensor.read_noise_e**2 + sensor.gain_e**2 / 12
        # Poisson: the variance of a count is the count.
        variance = flux * image + other[:, None, None]
        along_x = flux * share[:, 1, :, None] * slope[:, 0, None, :]
        along_y = flux * slope[:, 1, :, None] * share[:, 0, None, :]
        information = [(d**2 / variance).sum(axis=(1, 2)) for d in (along_x, along_y)]
        snr[k : k + 500] = np.sqrt(((flux * image) ** 2 / variance).sum(axis=(1, 2)))
        bound[k : k + 500] = np.sqrt(0.5 / information[0] + 0.5 / information[1])
        top[k : k + 500] = (flux * image).max(axis=(1, 2)) + level[k : k + 500]
    clipped = top / sensor.gain_e + sensor.bias >= 0.97 * sensor.saturation
    return DetectionTruth(xy, snr, bound, fwhm_px, clipped)


def score(found: Floats, truth: DetectionTruth, snr: float = 10.0) -> dict[str, float]:
    """Completeness at ``snr``, purity, and centroid RMS over the bound of places (M, 2) px.

    A star is found when a place lies within half a FWHM (at least a pixel) of it, and a place is true when a star
    of any brightness does. Centroids count for every found star above ``snr`` that does not clip and has no
    neighbour within 4 FWHM; their mean square error is taken in units of each star's own bound.
    """
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


# -- Other detectors, called as their own documentation shows, on the frame as it comes --------

Finder = Callable[[Frame, float], Floats]


def kochab(frame: Frame, fwhm_px: float) -> Floats:
    """Our default detector, which does not know the FWHM."""
    return DETECTORS.make("auto").detect(frame).xy


def sep_winpos(frame: Frame, fwhm_px: float) -> Floats:
    """sep: background, extraction with its default kernel, windowed positions."""
    import sep

    data = frame.pixels.astype(np.float32)
    background = sep.Background(data)
    background.subfrom(data)
    objects = sep.extract(data, 3.0, err=background.globalrms)
    sigma = np.full(len(objects), fwhm_px / FWHM_PER_SIGMA)
    x, y, _ = sep.winpos(data, objects["x"], objects["y"], sigma)
    return np.stack([x, y], axis=1)


def dao_star_finder(frame: Frame, fwhm_px: float) -> Floats:
    """photutils: clipped statistics and DAOStarFinder, which is given the FWHM."""
    from astropy.stats import sigma_clipped_stats

    data = frame.pixels.astype(np.float32)
    _, median, std = sigma_clipped_stats(data, sigma=3.0)
    return found_places("DAOStarFinder", data - median, 5.0 * std, fwhm_px)


def seiza(frame: Frame, fwhm_px: float) -> Floats:
    """seiza: its detector for linear pixels."""
    import seiza

    stars = seiza.detect(frame.pixels.astype(np.float32), max_stars=10_000)
    return np.array([(s.x, s.y) for s in stars], dtype=np.float64).reshape(-1, 2)


FINDERS: dict[str, Finder] = {"kochab": kochab, "sep": sep_winpos, "DAOStarFinder": dao_star_finder, "seiza": seiza}


def finders() -> dict[str, Finder]:
    """Those that can be imported here, each called once so that importing is not timed."""
    small = Frame(np.random.default_rng(0).normal(500, 20, (256, 256)).astype(np.uint16))
    ready = {}
    for name, find in FINDERS.items():
        with contextlib.suppress(ImportError):
            find(small, 3.0)
            ready[name] = find
    return ready


SIZES = {1: (1224, 816), 6: (3000, 2000), 24: (6000, 4000), 61: (9576, 6388)}  # MP: px
SLOW = ("DAOStarFinder",)  # timed once a field


@frozen
class RenderedField:
    """One rendered field: its size, number of stars, their FWHM, how often it is timed."""

    megapixels: int
    stars: int
    fwhm_px: float
    turns: int = 3
    seed: int = 1


JUDGED = RenderedField(24, 500, 3.0, turns=9)  # the field whose milliseconds the goals are about
QUICK = (RenderedField(1, 50, 3.0), RenderedField(6, 500, 2.0), JUDGED)
FULL = (
    *(RenderedField(1, 50, fwhm_px) for fwhm_px in (2.0, 5.0)),
    *(RenderedField(6, 500, fwhm_px) for fwhm_px in (2.0, 3.0, 5.0)),
    *(RenderedField(24, 50, 3.0), RenderedField(24, 500, 2.0), JUDGED),
    *(RenderedField(24, 500, 5.0), RenderedField(24, 5000, 3.0)),
    *(RenderedField(61, 500, 3.0), RenderedField(61, 5000, 4.0)),
)


def run(quick: bool, report: Report) -> BenchResult:
    """Measure every detector that is here on every field."""
    found = finders()
    rows: list[Row] = []
    for field in QUICK if quick else FULL:
        report(f"{field.megapixels} MP, {field.stars} stars, FWHM {field.fwhm_px:g} px ...")
        frame, truth = make_field(field)
        rows += measure_field(field, frame, truth, found)
    return BenchResult("detect", rows, goals(rows))


def make_field(field: RenderedField) -> tuple[Frame, DetectionTruth]:
    """A frame with a gradient and 30 hot pixels a megapixel, and what is in it.

    Fluxes follow N(>F) ~ F^-0.9 from half the flux that gives SNR 10, so that about half of all
    stars are above SNR 10 and the brightest clip.
    """
    width, height = SIZES[field.megapixels]
    rng = np.random.default_rng(field.seed)
    sky, sensor = Sky(400.0, (80.0, 60.0), hot_per_mp=30.0), Sensor()
    xy = rng.uniform(8.0, [width - 9.0, height - 9.0], (field.stars, 2))
    sigma = field.fwhm_px / FWHM_PER_SIGMA
    # SNR 10 on the background alone is 10 sqrt(v 4 pi sigma^2) electrons, 4 pi sigma^2 the noise area of a Gaussian.
    faintest = 5.0 * np.sqrt((sky.level_e + sensor.read_noise_e**2) * 4 * np.pi * sigma**2)
    flux = np.minimum(faintest * rng.uniform(0.0, 1.0, field.stars) ** (-1 / 0.9), 3e6)
    frame = render(width, height, xy, flux, RenderedStar(field.fwhm_px), sky, sensor, field.seed)
    return frame, expected(xy, flux, field.fwhm_px, sky, sensor, (width, height))


def measure_field(
    field: RenderedField, frame: Frame, truth: DetectionTruth, found: Mapping[str, Finder]
) -> list[dict[str, Any]]:
    """One row a detector, and one for reading every pixel once (``np.max``).

    Parameters
    ----------
    field : RenderedField
        What the frame shows, and how often it is measured.
    frame : Frame
        The frame.
    truth : DetectionTruth
        Where its stars are, and the best that can be done.
    found : Mapping[str, Finder]
        The detectors by name.
    """
    every: dict[str, Finder] = {"np.max": lambda one, _: one.pixels.max(), **found}
    spent_s: dict[str, list[tuple[float, float]]] = {name: [] for name in every}
    for turn in range(field.turns):
        for name, find in every.items():
            if name in SLOW and turn:
                continue
            (_, cpu_s), wall_s = timed(partial(timed, partial(find, frame, field.fwhm_px)), time.perf_counter)
            spent_s[name].append((wall_s, cpu_s))
    rows = []
    for name in every:
        wall_ms, cpu_ms = (1e3 * np.median(spent_s[name], axis=0)).tolist()
        row: dict[str, Any] = {"mp": field.megapixels, "stars": field.stars, "fwhm_px": field.fwhm_px}
        row |= {"detector": name, "wall_ms": wall_ms, "cpu_ms": cpu_ms}
        if name in found:
            xy, extra = _with_memory(found[name], frame, field.fwhm_px)
            row |= {"found": len(xy)} | score(xy, truth) | {"memory": extra}
        rows.append(row)
    return rows


def _with_memory(find: Finder, frame: Frame, fwhm_px: float) -> tuple[Floats, float]:
    """Places, and the peak of what Python and numpy allocated as a fraction of the frame.

    In a new thread, so that memory kept from the turns before is counted again.
    """
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    try:
        with ThreadPoolExecutor(1) as fresh:
            xy = fresh.submit(find, frame, fwhm_px).result()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return xy, (peak - before) / frame.pixels.nbytes


def goals(rows: list[Row]) -> list[Goal]:
    """The numbers that were asked for; the worst of all fields where quality is concerned."""
    ours = [row for row in rows if row["detector"] == "kochab"]
    judged = {
        row["detector"]: row
        for row in rows
        if (row["mp"], row["stars"], row["fwhm_px"]) == (JUDGED.megapixels, JUDGED.stars, JUDGED.fwhm_px)
    }
    ms = judged["kochab"]["cpu_ms"]

    def times(name: str) -> float | None:
        return judged[name]["cpu_ms"] / ms if name in judged else None

    return [
        Goal.at_most("24 MP, 500 stars: ms", ms, 25.0),
        Goal.at_least("24 MP: times faster than sep", times("sep"), 10.0),
        Goal.at_least("24 MP: times faster than DAOStarFinder", times("DAOStarFinder"), 80.0),
        Goal.at_least("completeness at SNR 10, worst", min(r["completeness"] for r in ours), 0.99),
        Goal.at_least("purity, worst", min(r["purity"] for r in ours), 0.97),
        Goal.at_most("centroid RMS / bound, worst", max(r["rms_over_bound"] for r in ours), 1.1),
        Goal.at_most("24 MP: extra memory / frame", judged["kochab"]["memory"], 0.3),
    ]
