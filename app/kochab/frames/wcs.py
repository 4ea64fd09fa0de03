"""A solution written as a world coordinate system: a ``.wcs`` file, or a solved copy of a FITS file."""

import gzip
import os
import re
import shutil
import zlib
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from kochab.core.errors import FrameError
from kochab.core.solution import Solution
from kochab.core.wcs import wcs_cards
from kochab.frames.atomic_file import atomic_file, write_atomically
from kochab.frames.fits import BLOCK, CARD, find_image
from kochab.frames.outputs import same_file

_COPIED_BYTES = 1 << 20
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
    return text.ljust(-(-len(text) // BLOCK) * BLOCK)


def write_wcs(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write the ``.wcs`` file; raises OSError when that is not possible."""
    write_atomically(path, wcs_text(solution))


def write_solved_copy(solution: Solution, source: str | os.PathLike[str], target: str | os.PathLike[str]) -> None:
    """Copy a FITS file, its first image's old WCS replaced by this one, all its other bytes as they are.

    The target appears whole or not at all, and may be the source itself, which then stays gzipped
    if it was; another is gzipped when it is named ``.gz``.

    Raises FrameError when the source is not FITS with an image, or the target cannot be written.
    """
    name = Path(source).name
    try:
        with atomic_file(target) as part, open(source, "rb") as raw, ExitStack() as closing:
            file: Any = raw
            if packed := raw.read(2) == b"\x1f\x8b":
                raw.seek(0)
                file = gzip.GzipFile(fileobj=raw)
            image = find_image(file)
            file.seek(0)
            before, header = file.read(image.start), file.read(image.offset - image.start)
            out: Any = closing.enter_context(part.open("wb"))
            if packed if same_file(source, target) else Path(target).suffix.lower() == ".gz":
                out = closing.enter_context(gzip.GzipFile(name.removesuffix(".gz"), "wb", fileobj=out))
            out.write(before + _with_wcs(header, solution))
            shutil.copyfileobj(file, out, _COPIED_BYTES)
    except FrameError as error:
        raise FrameError("{name} {error}", name=name, error=error) from None
    except (OSError, EOFError, zlib.error) as error:
        text = getattr(error, "strerror", None) or str(error)
        raise FrameError("{target} cannot be written: {text}.", target=target, text=text.rstrip(".")) from None


def _with_wcs(header: bytes, solution: Solution) -> bytes:
    """The header with its old WCS replaced, a whole number of blocks; cards that break the standard stay."""
    from astropy.io.fits import Card

    cards, dropped = [], False
    for at in range(0, len(header), CARD):
        card = header[at : at + CARD]
        name = card[:8].decode("latin-1").rstrip(" \0")
        if name == "END":
            break
        # A CONTINUE card belongs to the one before it and goes with it.
        dropped = bool(_OLD.match(name)) or (dropped and name == "CONTINUE")
        if not dropped:
            cards.append(card)
    cards += [str(Card(*card)).encode("ascii") for card in wcs_cards(solution.camera, solution.attitude)]
    text = b"".join(cards) + b"END"
    return text.ljust(-(-len(text) // BLOCK) * BLOCK)
