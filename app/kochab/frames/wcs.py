"""A solution written as a world coordinate system: a ``.wcs`` file, or a solved copy of a FITS file."""

import os
import re
from typing import TYPE_CHECKING, Any

from kochab.core.errors import FrameError
from kochab.core.solution import Solution
from kochab.core.wcs import wcs_cards
from kochab.frames.atomic_file import atomic_file, write_atomically
from kochab.frames.fits import check_tables

if TYPE_CHECKING:
    from astropy.io.fits import Header


_BLOCK = 2880  # FITS files come in blocks of this many bytes
_OLD = re.compile(
    r"(WCSAXES|CTYPE\d|CUNIT\d|CRVAL\d|CRPIX\d|CDELT\d|CROTA\d|CD\d_\d|PC\d_\d|PV\d_\d+"
    r"|LONPOLE|LATPOLE|RADESYS|RADECSYS|EQUINOX|(A|B|AP|BP)_(ORDER|DMAX|\d_\d)|PLTSOLVD)$"
)


def wcs_text(solution: Solution) -> str:
    """A ``.wcs`` file's text: a FITS header without an image that is also one card a line.

    Some programs write such files as FITS and some as lines of text, and read only their own kind.
    The 80th character of each card is a line's end here, where FITS readers see the blank end of
    a comment, so that both kinds find what they expect; after END come the blanks of FITS.
    """
    from astropy.io.fits import Card

    camera = solution.camera
    start: list[tuple[str, Any, str]] = [
        ("SIMPLE", True, "header only"),
        ("BITPIX", 8, ""),
        ("NAXIS", 0, "no image"),
        ("IMAGEW", camera.width, "[px] width of the solved frame"),
        ("IMAGEH", camera.height, "[px] height of the solved frame"),
    ]
    cards = [str(Card(*card))[:79].ljust(79) + "\n" for card in start + wcs_cards(solution.camera, solution.attitude)]
    text = "".join(cards) + "END"
    return text.ljust(-(-len(text) // _BLOCK) * _BLOCK)


def write_wcs(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write the ``.wcs`` file; raises OSError when that is not possible."""
    write_atomically(path, wcs_text(solution))


def write_solved_copy(solution: Solution, source: str | os.PathLike[str], target: str | os.PathLike[str]) -> None:
    """Copy a FITS file, its first image's old WCS replaced by this one, its data untouched.

    The target appears whole or not at all, and may be the source itself.

    Raises FrameError when the source is not FITS with an image, or the target cannot be written.
    """
    import warnings

    from astropy.io import fits

    try:
        check_tables(source)
        with atomic_file(target) as part, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with fits.open(
                source,
                memmap=False,
                do_not_scale_image_data=True,
                disable_image_compression=True,
                ignore_missing_simple=True,
            ) as hdus:
                _replace_wcs(_first_image(hdus).header, solution)
                hdus.writeto(part, overwrite=True, output_verify="silentfix+ignore")
    except FrameError:
        raise
    except Exception as error:  # astropy raises many kinds for damaged headers
        text = " ".join(str(getattr(error, "strerror", None) or error).split())[:150]
        raise FrameError(f"{target} cannot be written: {text.rstrip('.')}.") from None


def _first_image(hdus: Any) -> Any:
    for hdu in hdus:
        prefix = "Z" if hdu.header.get("ZIMAGE") is True else ""
        if prefix or hdu.header.get("XTENSION", "IMAGE") == "IMAGE":
            axes = hdu.header.get(f"{prefix}NAXIS", 0)
            sizes = [hdu.header.get(f"{prefix}NAXIS{i + 1}", 0) for i in range(axes)]
            if sum(size > 1 for size in sizes) >= 2:
                return hdu
    raise FrameError("The FITS file holds no image to write a solution to.")


def _replace_wcs(header: "Header", solution: Solution) -> None:
    for keyword in {str(k) for k in header if _OLD.match(str(k))}:
        header.remove(keyword, ignore_missing=True, remove_all=True)
    for keyword, value, comment in wcs_cards(solution.camera, solution.attitude):
        header[keyword] = (value, comment)
