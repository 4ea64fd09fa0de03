"""Kochab finds where a camera points: plate solving for telescopes, lenses and star trackers.

>>> import kochab
>>> solution = kochab.solve("orion.png")
>>> f"RA {solution.ra_dec_deg[0]:.2f}, Dec {solution.ra_dec_deg[1]:+.2f}"
'RA 84.00, Dec -1.50'
>>> solution.wcs.pixel_to_world(0, 0).to_string("hmsdms", precision=0)
'06h09m23s +01d49m19s'
"""

import os

from kochab.core import __version__

TYPE_CHECKING = False  # as in `kochab.cli.faces`
if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from kochab.core.attitude import Attitude
    from kochab.core.camera import Camera
    from kochab.core.errors import CatalogueError, FrameError, KochabError, UsageError
    from kochab.core.frame import Detections, Frame, Hint, Site
    from kochab.core.solution import NamedStar, NoSolution, Reason, Solution
    from kochab.frames import read_frame
    from kochab.sky import Catalogue, open_catalogue
    from kochab.solver import SolveOptions

    FrameLike = str | os.PathLike[str] | ArrayLike | Frame

__all__ = [
    "Attitude",
    "Camera",
    "Catalogue",
    "CatalogueError",
    "Detections",
    "Frame",
    "FrameError",
    "Hint",
    "KochabError",
    "NamedStar",
    "NoSolution",
    "Reason",
    "Site",
    "Solution",
    "UsageError",
    "__version__",
    "detect",
    "identify",
    "open_catalogue",
    "read_frame",
    "solve",
]

# Imported when first used (PEP 562): `import kochab` alone costs no numpy.
_HOMES = {
    "kochab.core.attitude": ("Attitude",),
    "kochab.core.camera": ("Camera",),
    "kochab.core.errors": ("CatalogueError", "FrameError", "KochabError", "UsageError"),
    "kochab.core.frame": ("Detections", "Frame", "Hint", "Site"),
    "kochab.core.solution": ("NamedStar", "NoSolution", "Reason", "Solution"),
    "kochab.frames": ("read_frame",),
    "kochab.sky": ("Catalogue", "open_catalogue"),
}


def __getattr__(name: str) -> "Any":
    from importlib import import_module

    for module, names in _HOMES.items():
        if name in names:
            # Kept in the module, so that the next use finds the name without coming here.
            return globals().setdefault(name, getattr(import_module(module), name))
    raise AttributeError(f"module 'kochab' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def solve(
    source: "FrameLike",
    *,
    fov: float | None = None,
    scale: float | None = None,
    near: tuple[float, float, float] | None = None,
    method: str = "patterns",
    detector: str = "auto",
    timeout: float | None = 30.0,
    **options: "Any",
) -> "Solution | NoSolution":
    """Plate solve a frame: detect its stars, identify them, fit the pointing and the camera.

    Parameters
    ----------
    source : path, array or Frame
        A file in any format Kochab reads; pixels (H, W), or (H, W, 3) in colour, row 0 at the top;
        or a :class:`Frame`, whose ``hint`` is used.
    fov, scale : float, optional
        Width of the frame, degrees, or pixel scale, arcsec/px, good to a tenth; ``fov`` is used
        where both are given. Hints save time. A wrong one costs time, never the solution.
    near : (RA, Dec, radius), optional
        Where the frame points, ICRS degrees.
    method, detector : str
        How stars are identified and detected; ``kochab solve --methods`` lists them.
    timeout : float or None
        Longest search, seconds; None searches to the end. Making the patterns for small fields,
        once on a machine, does not count.
    **options
        Other fields of :class:`kochab.solver.SolveOptions`, such as ``method_options``,
        ``attitude`` or ``aberration``.

    Returns
    -------
    Solution or NoSolution
        A frame that cannot be solved is no error: ``NoSolution`` says why, and what to do.

    Raises
    ------
    FrameError
        The file, or the array, is not an image.
    UsageError
        An argument cannot be used.

    Examples
    --------
    >>> solution = solve("pleiades.fits", near=(57, 24, 5))
    >>> f"{solution.camera.scale_arcsec_px:.2f} arcsec/px, {solution.roll_deg:.0f} deg east of north"
    '10.00 arcsec/px, -28 deg east of north'
    >>> solution.stars[0].name
    'Alcyone'
    >>> import numpy as np
    >>> str(solve(np.zeros((600, 800))).reason)
    'clouded or dark'

    """
    from kochab.core.progress import run
    from kochab.solver.pipeline import solve_frame

    chosen = _options(fov, scale, near, timeout, method=method, detector=detector, **options)
    return run(solve_frame(_frame(source), chosen))


def identify(
    xy: "ArrayLike",
    width: int,
    height: int,
    *,
    flux: "ArrayLike | None" = None,
    fov: float | None = None,
    scale: float | None = None,
    near: tuple[float, float, float] | None = None,
    method: str = "patterns",
    timeout: float | None = 30.0,
    **options: "Any",
) -> "Solution | NoSolution":
    """Plate solve a list of stars that another program has detected.

    Parameters
    ----------
    xy : (N, 2)
        Pixels x, y; (0, 0) is the centre of the first pixel, y grows downwards.
    width, height : int
        Size of the frame, px.
    flux : (N,), optional
        In any linear unit. Without it the stars must come brightest first.
    fov, scale, near, method, timeout, **options
        As in :func:`solve`, whose results and errors these are.

    Examples
    --------
    >>> stars = detect("orion.png")
    >>> solution = identify(stars.xy, stars.width, stars.height, flux=stars.flux)
    >>> solution.log10_false_alarm < -30
    True

    """
    import numpy as np

    from kochab.core.errors import UsageError
    from kochab.core.frame import Detections
    from kochab.core.progress import run
    from kochab.solver.pipeline import solve_detections

    places = np.asarray(xy, dtype=np.float64)
    light = None if flux is None else np.asarray(flux, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 2 or (light is not None and light.shape != places.shape[:1]):
        raise UsageError("xy must be an array (N, 2), and flux one of (N,).")
    if min(width, height) < 1:
        raise UsageError(f"A frame of {width} x {height} px holds no stars.")
    stars = Detections.from_list(places, width, height, light)
    return run(solve_detections(stars, _options(fov, scale, near, timeout, method=method, **options)))


def detect(source: "FrameLike", detector: str = "auto", **options: "Any") -> "Detections":
    """Find the stars of a frame, given as for :func:`solve`, brightest first.

    ``options`` are those of the ``detector``. Raises FrameError and UsageError as :func:`solve`.

    Examples
    --------
    >>> stars = detect("orion.png", max_stars=100)
    >>> len(stars), stars.xy.shape
    (100, (100, 2))

    """
    from kochab.detection import DETECTORS

    return DETECTORS.make(detector, **options).detect(_frame(source))


def _frame(source: "FrameLike") -> "Frame":
    import numpy as np

    from kochab.core.errors import FrameError
    from kochab.core.frame import Frame
    from kochab.frames import finite, read_frame, split

    if isinstance(source, Frame):
        return source
    if isinstance(source, str | os.PathLike):
        return read_frame(source)
    samples = np.asarray(source)
    if samples.ndim not in (2, 3) or 0 in samples.shape:
        raise FrameError(f"An array of shape {samples.shape} is not an image: give (H, W) or (H, W, 3).")
    try:
        pixels, colour, saturation = split(samples)
        pixels, warnings = finite(pixels)
    except FrameError as error:  # readers put the file's name before these words
        raise FrameError(f"The array {error}") from None
    return Frame(pixels, colour, saturation=saturation, warnings=warnings)


def _options(
    fov: float | None,
    scale: float | None,
    near: tuple[float, float, float] | None,
    timeout: float | None,
    **options: "Any",
) -> "SolveOptions":
    from kochab.core.errors import UsageError
    from kochab.core.frame import Hint
    from kochab.solver import SolveOptions

    for name, value, limit in (("fov", fov, 180.0), ("scale", scale, 36000.0)):
        if value is not None and not 0.0 < value < limit:
            raise UsageError(f"{name} is {value:g}; it must be above 0 and below {limit:g}.")
    if near is not None:
        ra, dec, radius = near
        if not (-360.0 <= ra <= 720.0 and abs(dec) <= 90.0 and 0.0 < radius <= 180.0):
            raise UsageError(f"near is {near}; it must be (RA, Dec, radius) in degrees.")
        near = ra % 360.0, dec, radius
    # A range symmetric in the ratio: a scale that is a tenth too large is as likely as one too small.
    tenth = None if scale is None else (scale / 1.1, scale * 1.1)
    hint = Hint(scale_arcsec_px=tenth, centre_deg=near, source="caller")
    return SolveOptions(hint=hint if hint.helps else None, fov_deg=fov, timeout_s=timeout, **options)
