"""A solution written as a world coordinate system: a ``.wcs`` file, or a solved copy of a FITS file."""

import bz2
import gzip
import os
import re
import shutil
import warnings
import zlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from kochab.core.errors import FrameError
from kochab.core.frame import Frame
from kochab.core.solution import Solution
from kochab.core.wcs import wcs_cards
from kochab.frames.atomic_file import atomic_file, write_atomically
from kochab.frames.fits import BLOCK, CARD, find_image, pack_of
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

    The target appears whole or not at all, and may be the source itself, which then stays packed
    as it was; another is packed when it is named ``.gz`` or ``.bz2``.

    Raises FrameError when the source is not FITS with an image, or the target cannot be written.
    """
    name = Path(source).name
    try:
        with atomic_file(target) as part, open(source, "rb") as raw, ExitStack() as closing:
            pack = pack_of(raw)
            file: Any = raw if pack is None else pack(raw)
            image = find_image(file)
            file.seek(0)
            before, header = file.read(image.start), file.read(image.offset - image.start)
            out: Any = closing.enter_context(part.open("wb"))
            suffix = Path(target).suffix.lower()
            if same_file(source, target):  # whatever it is called
                suffix = "" if pack is None else ".bz2" if pack is bz2.BZ2File else ".gz"
            if suffix == ".gz":
                out = closing.enter_context(gzip.GzipFile(name.removesuffix(".gz"), "wb", fileobj=out))
            elif suffix == ".bz2":
                out = closing.enter_context(bz2.BZ2File(out, "wb"))
            out.write(before + _with_wcs(header, solution))
            shutil.copyfileobj(file, out, _COPIED_BYTES)
    except FrameError as error:
        raise FrameError("{name} {error}", name=name, error=error) from None
    except (OSError, EOFError, zlib.error) as error:
        text = getattr(error, "strerror", None) or str(error)
        raise FrameError("{target} cannot be written: {text}.", target=target, text=text.rstrip(".")) from None


def write_with_solution(
    frame_of: Callable[[], Frame],
    solution: Solution,
    source: str | os.PathLike[str] | None,
    target: str | os.PathLike[str],
) -> None:
    """Write a solved frame as FITS: a copy of its file where that is FITS, else the frame itself.

    Raises FrameError when the source cannot be read or the target cannot be written.

    Parameters
    ----------
    frame_of : Callable[[], Frame]
        Gives what was read; not asked where the file is copied.
    solution : Solution
        Where it points.
    source : path or None
        The frame's file, None where it has none.
    target : path
        Where the FITS appears, whole or not at all; it may be the source.
    """
    from kochab.frames.fits_write import write_fits
    from kochab.frames.readers import named_as_fits

    if source is None or not named_as_fits(source):
        try:
            write_fits(frame_of(), target)
        except OSError as error:
            text = error.strerror or str(error)
            raise FrameError("{target} cannot be written: {text}.", target=target, text=text) from None
        source = target
    write_solved_copy(solution, source, target)


def wcs_of(values: Mapping[str, Any]) -> Any:
    """The `astropy.wcs.WCS` of a header's values, None when it has none of the sky.

    Only the cards of a WCS with numbers and text that FITS can hold are given to the library.

    Raises ValueError when it cannot be used.
    """
    from astropy.io.fits import Header
    from astropy.wcs import WCS

    old_cards = {name: value for name, value in values.items() if _OLD.match(name) and value is not None}
    if bad := [name for name, value in old_cards.items() if not _may_be(name, value)]:
        raise ValueError(bad[0])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            wcs = WCS(Header([*old_cards.items()]), naxis=2)  # a colour image may count its colours
            return wcs if wcs.has_celestial else None
    except (LookupError, TypeError, AttributeError, ArithmeticError) as error:  # of cards that lack others
        raise ValueError(str(error)) from None


def _may_be(name: str, value: Any) -> bool:
    """Whether a card of a WCS may have this value: a line of ASCII, a small count, or a number that is not vast."""
    if re.match("CTYPE|CUNIT|RADE", name):
        return isinstance(value, str) and value.isascii() and value.isprintable() and len(value) <= 68
    if name == "PLTSOLVD":
        return True
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    # Whoever makes room for a polynomial of the order that a card tells may make gigabytes of it.
    return value in range(10) if name == "WCSAXES" or name.endswith("_ORDER") else abs(value) < 1e30


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
