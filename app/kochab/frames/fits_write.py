"""A frame to FITS, so that reading it again gives the same pixels, pattern and hints."""

import io
import math
import os
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from kochab.core import __version__
from kochab.core.frame import Frame
from kochab.frames.atomic_file import write_atomically

KEPT = (  # noqa: SIM905
    "OBJECT TELESCOP FOCALLEN XPIXSZ YPIXSZ XBINNING YBINNING GAIN OFFSET CCD-TEMP FILTER OBSERVER"
).split()
"""What a camera said of itself that is carried over as it was."""


def write_fits(frame: Frame, path: str | os.PathLike[str]) -> None:
    """Write ``frame``; whoever watches the folder sees the whole file or none.

    Raises OSError when that is not possible.
    """
    write_atomically(path, fits_bytes(frame))


def fits_bytes(frame: Frame) -> bytes:
    """The FITS file of ``frame``; row 0 of the array is the top of the screen, and it says so.

    A colour frame is kept as three planes, from which reading makes the same luminance.
    """
    from astropy.io import fits

    data = frame.pixels if frame.colour is None else np.moveaxis(frame.colour, -1, 0)
    hdu = fits.PrimaryHDU(np.ascontiguousarray(data))
    for name, value, comment in _cards(frame):
        hdu.header[name] = (value, comment)
    out = io.BytesIO()
    hdu.writeto(out)
    return out.getvalue()


def _cards(frame: Frame) -> list[tuple[str, Any, str]]:
    hint = frame.hint
    cards: list[tuple[str, Any, str]] = [
        ("ROWORDER", "TOP-DOWN", "first row is the top of the picture"),
        ("CREATOR", f"Kochab {__version__}", ""),
    ]
    if frame.bayer is not None:
        cards.append(("BAYERPAT", frame.bayer, "from the first pixel of the first row"))
    # For colour, saturation is that of the luminance, which is not what is written.
    if frame.saturation is not None and frame.colour is None:
        cards.append(("SATURATE", frame.saturation, "pixels clip here"))
    if hint.time_utc is not None:
        half = timedelta(seconds=(hint.exposure_s or 0.0) / 2.0)
        cards.append(("DATE-OBS", _iso(hint.time_utc - half), "UTC, exposure begins"))
        cards.append(("DATE-AVG", _iso(hint.time_utc), "UTC, mid-exposure"))
    if hint.exposure_s is not None:
        cards.append(("EXPTIME", hint.exposure_s, "[s]"))
    if hint.camera:
        cards.append(("INSTRUME", hint.camera[:60], ""))
    if hint.scale_arcsec_px is not None:
        # The geometric mean of the range.
        cards.append(("SCALE", math.sqrt(math.prod(hint.scale_arcsec_px)), "[arcsec/px]"))
    if hint.centre_deg is not None:
        cards.append(("RA", hint.centre_deg[0], "[deg] as believed"))
        cards.append(("DEC", hint.centre_deg[1], "[deg] as believed"))
    if hint.site is not None:
        cards.append(("SITELAT", hint.site.latitude_deg, "[deg] north"))
        cards.append(("SITELONG", hint.site.longitude_deg, "[deg] east"))
        cards.append(("SITEELEV", hint.site.height_m, "[m]"))
    written = {name for name, _, _ in cards}
    for name in KEPT:
        value = frame.header.get(name)
        if name not in written and _writable(value):
            cards.append((name, value, ""))
    return cards


def _writable(value: Any) -> bool:
    if isinstance(value, str):
        return value.isascii() and value.isprintable() and 0 < len(value) <= 60
    return isinstance(value, bool | int) or (isinstance(value, float) and math.isfinite(value))


def _iso(moment: datetime) -> str:
    """UTC to the microsecond, without the zone, as FITS wants it."""
    return moment.replace(tzinfo=None).isoformat(timespec="microseconds")
