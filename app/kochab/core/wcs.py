"""A pointing as a FITS world coordinate system: TAN, ARC behind a fisheye lens, with SIP where the lens distorts.

After Calabretta and Greisen 2002 (FITS paper II, the gnomonic projection and the
zenithal equidistant one) and Shupe et al. 2005 (the
SIP convention). FITS counts pixels from 1 and so do ``CRPIX1`` and ``CRPIX2`` here; its rows are
the array's, so that a frame read from FITS and its file share their pixels.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import Attitude, east_north
from kochab.core.camera import Camera, FisheyeCamera

if TYPE_CHECKING:
    from astropy.wcs import WCS

Term = tuple[int, int]

_GOOD_PX = 0.005
_ORDERS = range(3, 10)  # SIP allows 2 to 9
_GRID = 41
_FISHEYE_RAD = 1.62
"""Farther from the axis, 93 deg, is the frame beside a fisheye lens's circle, which shows no sky."""


def wcs_cards(camera: Camera, attitude: Attitude) -> list[tuple[str, Any, str]]:
    """A pointing as FITS cards (keyword, value, comment), in the order they are written.

    The reference point is the principal point. Distortion becomes ``A``, ``B`` (pixel to sky) and ``AP``, ``BP`` (sky
    to pixel) of the lowest order that is good to 0.005 px on the whole frame, or of order 9.
    """
    ra, dec = attitude.ra_dec_deg
    cd = _cd_matrix(camera, attitude)
    code = "ARC" if isinstance(camera, FisheyeCamera) else "TAN"
    sip = "-SIP" if camera.distorted else ""
    cards: list[tuple[str, Any, str]] = [
        ("WCSAXES", 2, "celestial axes"),
        ("CTYPE1", f"RA---{code}{sip}", f"{camera.projection} projection"),
        ("CTYPE2", f"DEC--{code}{sip}", f"{camera.projection} projection"),
        ("CUNIT1", "deg", ""),
        ("CUNIT2", "deg", ""),
        ("RADESYS", "ICRS", ""),
        ("EQUINOX", 2000.0, ""),
        ("CRPIX1", camera.cx + 1.0, "principal point, first pixel is 1"),
        ("CRPIX2", camera.cy + 1.0, ""),
        ("CRVAL1", ra, "[deg] right ascension there"),
        ("CRVAL2", dec, "[deg] declination there"),
        ("CD1_1", cd[0, 0], "[deg/px]"),
        ("CD1_2", cd[0, 1], "[deg/px]"),
        ("CD2_1", cd[1, 0], "[deg/px]"),
        ("CD2_2", cd[1, 1], "[deg/px]"),
        ("LONPOLE", 180.0, "[deg]"),
        ("LATPOLE", dec, "[deg]"),
    ]
    if camera.distorted:
        cards += _sip_cards(camera)
    return [*cards, ("PLTSOLVD", True, "solved by Kochab")]


def astropy_wcs(camera: Camera, attitude: Attitude) -> "WCS":
    """The same as an `astropy.wcs.WCS`, which knows the frame's size in pixels."""
    from astropy.io.fits import Header
    from astropy.wcs import WCS

    wcs = WCS(Header([*wcs_cards(camera, attitude)]))
    wcs.pixel_shape = (camera.width, camera.height)
    return wcs


def _cd_matrix(camera: Camera, attitude: Attitude) -> Floats:
    """Degrees of (east, north) on the tangent plane a pixel of (x, y)."""
    matrix = attitude.matrix
    east, north = east_north(attitude.boresight)
    return np.asarray(np.degrees(np.stack([matrix[:2] @ east, matrix[:2] @ north]) / camera.focal_xy_px))


def _sip_cards(camera: Camera) -> list[tuple[str, Any, str]]:
    recorded, ideal = _grids(camera)
    cards: list[tuple[str, Any, str]] = []
    for names, start, end in ((("A", "B"), recorded, ideal), (("AP", "BP"), ideal, recorded)):
        order, terms, values, error_px = _fit(start, end - start)
        for column, name in enumerate(names):
            cards.append((f"{name}_ORDER", order, f"good to {error_px:.1g} px"))
            cards += [(f"{name}_{p}_{q}", float(values[i, column]), "") for i, (p, q) in enumerate(terms)]
    return cards


def _grids(camera: Camera) -> tuple[Floats, Floats]:
    """Offsets (N, 2) px from the principal point over the frame: recorded, and without distortion.

    Points crowd towards the edges, where polynomials go astray.
    """
    # Chebyshev spacing.
    place = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, _GRID))
    x, y = np.meshgrid(place * camera.width - 0.5, place * camera.height - 0.5)
    pixels = np.stack([x.ravel(), y.ravel()], axis=-1)
    rays = camera.unproject(pixels)
    flat = camera.plane(rays)
    # Beyond the fold of a barrel lens nothing was ever recorded: there is nothing to fit there.
    seen = np.hypot(*flat.T) < 0.9 * _fold_radius(camera)
    seen &= np.abs(camera.project(rays) - pixels).max(axis=1) < _GOOD_PX
    fisheye = isinstance(camera, FisheyeCamera)
    if fisheye:
        seen &= np.hypot(*flat.T) < _FISHEYE_RAD
    # With fewer than half the points the polynomial would be free over most of the frame.
    if fisheye or np.count_nonzero(seen) > len(seen) // 2:
        pixels, flat = pixels[seen], flat[seen]
    return pixels - np.array([camera.cx, camera.cy]), camera.focal_xy_px * flat


def _fold_radius(camera: Camera) -> float:
    """Where on the tangent plane the recorded radius stops growing, infinite if nowhere."""
    # The smallest positive root t = r^2 of 1 + 3 k1 t + 5 k2 t^2, the slope of the radius.
    square = 9.0 * camera.k1**2 - 20.0 * camera.k2
    if square < 0.0:
        return float("inf")
    divisor = -3.0 * camera.k1 + float(np.sqrt(square))
    return float(np.sqrt(2.0 / divisor)) if divisor > 1e-12 else float("inf")


def _fit(at: Floats, shift: Floats) -> tuple[int, list[Term], Floats, float]:
    """The polynomials (order, terms (p, q), coefficients (T, 2), worst error px) of a shift."""
    size = float(np.abs(at).max())
    # Scaled to -1..1: powers up to 9 of thousands of px would leave the fit no digits.
    x, y = (at / size).T
    best: tuple[int, list[Term], Floats, float] | None = None
    for order in _ORDERS:
        terms = [(p, q) for p in range(order + 1) for q in range(order + 1 - p) if p + q >= 2]
        design = np.stack([x**p * y**q for p, q in terms], axis=-1)
        scaled = np.linalg.lstsq(design, shift, rcond=None)[0]
        error = float(np.abs(design @ scaled - shift).max())
        powers = np.array([[size ** (p + q)] for p, q in terms])
        if best is None or error < best[3]:
            best = order, terms, scaled / powers, error
        if error < _GOOD_PX:
            break
    assert best is not None
    return best
