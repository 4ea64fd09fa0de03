"""Other detectors, called as their own documentation shows, on the frame as it comes."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from app.core.frame import Frame
from app.detect import make_detector

Floats = NDArray[np.float64]
Finder = Callable[[Frame, float], Floats]


def kochab(frame: Frame, fwhm_px: float) -> Floats:
    """Our default detector, which is not told the FWHM."""
    return make_detector("auto").detect(frame).xy


def sep_winpos(frame: Frame, fwhm_px: float) -> Floats:
    """sep: background, extraction with its default kernel, windowed positions."""
    import sep

    data = frame.pixels.astype(np.float32)
    background = sep.Background(data)
    background.subfrom(data)
    objects = sep.extract(data, 3.0, err=background.globalrms)
    sigma = fwhm_px / 2.3548
    x, y, _ = sep.winpos(data, objects["x"], objects["y"], np.full(len(objects), sigma))
    return np.stack([x, y], axis=1)


def dao_star_finder(frame: Frame, fwhm_px: float) -> Floats:
    """photutils: clipped statistics and DAOStarFinder, which is told the FWHM."""
    import warnings

    from astropy.stats import sigma_clipped_stats
    from photutils.detection import DAOStarFinder

    data = frame.pixels.astype(np.float32)
    _, median, std = sigma_clipped_stats(data, sigma=3.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sources = DAOStarFinder(fwhm=fwhm_px, threshold=5.0 * std)(data - median)
    if sources is None:
        return np.empty((0, 2))
    names = ("x_centroid", "y_centroid")  # "xcentroid" before photutils 3
    if names[0] not in sources.colnames:
        names = ("xcentroid", "ycentroid")
    return np.stack([np.asarray(sources[name], dtype=np.float64) for name in names], axis=1)


def seiza(frame: Frame, fwhm_px: float) -> Floats:
    """seiza: its detector for linear pixels."""
    import seiza

    stars = seiza.detect(frame.pixels.astype(np.float32), max_stars=10_000)
    return np.array([(s.x, s.y) for s in stars], dtype=np.float64).reshape(-1, 2)


FINDERS: dict[str, Finder] = {
    "kochab": kochab,
    "sep": sep_winpos,
    "DAOStarFinder": dao_star_finder,
    "seiza": seiza,
}


def finders() -> dict[str, Finder]:
    """Those that can be imported here, each called once so that importing is not timed."""
    small = Frame(np.random.default_rng(0).normal(500, 20, (256, 256)).astype(np.uint16))
    ready = {}
    for name, find in FINDERS.items():
        try:
            find(small, 3.0)
        except ImportError:
            continue
        ready[name] = find
    return ready
