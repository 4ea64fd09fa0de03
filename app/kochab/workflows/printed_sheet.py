"""Sheets to print, as PDF: a finder chart about an object, and a solved frame with the sky drawn over it.

Each has a card of what it shows, a scale, north and east, and a legend; text stays text.
"""

import io
import math
import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import attitude_from
from kochab.core.camera import ChartCamera
from kochab.core.errors import UsageError
from kochab.core.frame import Frame
from kochab.core.solution import Solution
from kochab.folders import data_folder
from kochab.frames.atomic_file import write_atomically
from kochab.frames.pdf import A4, LETTER, Page, read_font
from kochab.sky.catalogue import open_catalogue
from kochab.sky.finder import Found
from kochab.sky.kinds import kind_in_words
from kochab.sky.landmarks import name_of_field
from kochab.text.angle_text import AngleStyle, radec_text
from kochab.text.translation import number, tr, tr_noop
from kochab.workflows.annotated_image import (
    CREDIT,
    INKS,
    SHORT_CREDIT,
    USUAL,
    Drawing,
    dated_drawing,
    drawing_of,
    picture_of,
)

PAPERS = {"a4": A4, "letter": LETTER}
MARGIN, CARD, LEGEND = 36.0, 74.0, 46.0  # points: about the page, for the card above, for the legend below
CHART_PX = 1100  # the longer side that a chart is laid out on
NARROWEST_DEG, WIDEST_DEG, USUAL_DEG = 0.2, 90.0, 5.0
AROUND = 3.0  # so many times the object is shown
STARS = 2500
FAINTEST_R, STEP_R, LARGEST_R = 0.35, 0.32, 4.0  # radii of stars in points, and how they grow with a magnitude
PRINTED = {  # the inks of a chart on white paper, by those of a dark screen
    "star": "#000000",
    "galaxy": "#5b3fb0",
    "cluster": "#8a6500",
    "nebula": "#b0204e",
    "dark": "#555555",
    "ecliptic": "#9a6a00",
    "figure": "#56688c",
    "grid": "#9ab0c6",
    "grid_text": "#56708c",
}
LEGENDS = (
    ("galaxy", tr_noop("Galaxy")),
    ("cluster", tr_noop("Cluster")),
    ("nebula", tr_noop("Nebula")),
    ("dark", tr_noop("Dark nebula")),
)


def field_for(found: Found) -> float:
    """The field, degrees, that shows an object and what is around it."""
    size = max(found.size_arcmin or (0.0,)) / 60.0
    return float(np.clip(AROUND * size if size > USUAL_DEG / AROUND else USUAL_DEG, NARROWEST_DEG, WIDEST_DEG))


def finder_chart(found: Found, paper: str = "a4", field_deg: float | None = None) -> bytes:
    """A chart on white about what was found, north up, as a PDF of one page; UsageError for a field it can't show."""
    field = field_for(found) if field_deg is None else field_deg
    if not NARROWEST_DEG <= field <= WIDEST_DEG:
        raise UsageError("A chart shows {least:g} to {most:g}°.", least=NARROWEST_DEG, most=WIDEST_DEG)
    page = _page(paper, found.name)
    width, height = page.width - 2.0 * MARGIN, page.height - 2.0 * MARGIN - CARD - LEGEND
    camera = ChartCamera.of(round(CHART_PX * width / height), CHART_PX, field)
    sheet = Solution(camera, attitude_from(found.ra_deg, found.dec_deg, 0.0), (), 0.0, 0.0, "")
    layers = replace(USUAL, on=USUAL.on | {"compass": False, "boundaries": True})
    drawn, scale = drawing_of(sheet, layers=layers), width / camera.width
    corner = (MARGIN, MARGIN + CARD)
    page.clip(*corner, width, height)
    faintest = _stars(page, sheet, corner, scale)
    _marks(page, drawn, corner, scale, dict(zip(INKS.values(), (PRINTED.get(k, "#444444") for k in INKS), strict=True)))
    page.unclip()
    _frame(page, corner, width, height)
    facts = [
        kind_in_words(found.kind),
        radec_text(found.ra_deg, found.dec_deg, AngleStyle.SEXAGESIMAL),
        found.constellation,
    ]
    if math.isfinite(found.magnitude):
        facts.append(f"{found.band or 'V'} {found.magnitude:.1f}")
    if found.size_arcmin:
        facts.append(" × ".join(f"{side:.3g}" for side in dict.fromkeys(found.size_arcmin)) + "′")
    field_text = tr("Field {angle}°, stars to {mag}", angle=f"{field:.3g}", mag=f"{faintest:.1f}")
    _card(page, found.name, [" · ".join(facts), field_text])
    _compass(page, np.array([0.0, -1.0]), np.array([-1.0, 0.0]))
    _legend(page, sheet, scale, True, faintest)
    return page.packed()


def annotated_sheet(frame: Frame, solution: Solution, paper: str = "a4") -> bytes:
    """A solved frame with the sky over it and its facts, as a PDF of one page."""
    from kochab.frames.export import compass

    name = os.path.basename(frame.path) if frame.path else tr("Image")
    camera = solution.camera
    page = _page(paper, name, wide=camera.width > camera.height)
    room = page.width - 2.0 * MARGIN, page.height - 2.0 * MARGIN - CARD - LEGEND
    scale = min(room[0] / camera.width, room[1] / camera.height)
    width, height = camera.width * scale, camera.height * scale
    corner = (MARGIN + (room[0] - width) / 2.0, MARGIN + CARD)
    packed, picture = io.BytesIO(), picture_of(frame)
    picture.save(packed, format="JPEG", quality=90)
    page.picture(packed.getvalue(), picture.size, (*corner, width, height))
    layers = replace(USUAL, on=USUAL.on | {"compass": False})
    page.clip(*corner, width, height)
    _marks(page, dated_drawing(frame, solution, layers=layers), corner, scale, {})
    page.unclip()
    _frame(page, corner, width, height)
    wide, high = solution.camera.fov_deg
    place = radec_text(*solution.ra_dec_deg, AngleStyle.SEXAGESIMAL)
    turn = number(solution.roll_deg, "+.1f").replace("-", "−")
    facts = [
        f"{place} · {wide:.3g}° × {high:.3g}° · {camera.scale_arcsec_px:.4g}″/px",
        tr("Rotation {rotation} · {n} stars matched", rotation=f"{turn}°", n=len(solution.stars)),
    ]
    if frame.hint.time_utc is not None and not frame.hint.time_of_file:
        facts.append(f"{frame.hint.time_utc:%Y-%m-%d %H:%M:%S} UTC")
    _card(page, name_of_field(solution), [*facts[:-1], f"{facts[-1]} · {name}"])
    _compass(page, *compass(solution))
    _legend(page, solution, scale, False, math.nan)
    return page.packed()


def write_sheet(frame: Frame, solution: Solution, path: str | os.PathLike[str], paper: str = "a4") -> None:
    """Write :func:`annotated_sheet`; OSError when it cannot be.

    Parameters
    ----------
    frame : Frame
        The picture, and when it was taken.
    solution : Solution
        Where it points.
    path : str or os.PathLike
        The PDF.
    paper : str
        A name of `PAPERS`.
    """
    write_atomically(path, annotated_sheet(frame, solution, paper))


def _page(paper: str, title: str, wide: bool = False) -> Page:
    width, height = PAPERS[paper][::-1] if wide else PAPERS[paper]
    return Page(width, height, read_font(data_folder("resources") / "DejaVuSans.ttf"), title)


def _stars(page: Page, sheet: Solution, corner: tuple[float, float], scale: float) -> float:
    """Discs by magnitude; the faintest magnitude."""
    catalogue = open_catalogue()
    rows = catalogue.brightest(sheet.centre_vector, min(sheet.radius_rad, np.pi / 2.0), STARS)
    xy, mags = sheet.pixels_of(catalogue.vectors(rows)), catalogue.mag(rows)
    seen = np.isfinite(xy[:, 0])
    faintest = float(mags[seen].max(initial=0.0))
    radii = np.clip(FAINTEST_R + STEP_R * (faintest - mags[seen]), FAINTEST_R, LARGEST_R)
    page.discs((xy[seen] + 0.5) * scale + corner, radii.tolist(), "#000000")
    return faintest


def _marks(page: Page, drawn: Drawing, corner: tuple[float, float], scale: float, inks: dict[str, str]) -> None:
    """Strokes and words of a drawing; ``inks`` replaces colours. Words over a picture have a dark edge."""
    for xy, ink, width in drawn.strokes:
        page.line((xy + 0.5) * scale + corner, inks.get(ink[:7], ink[:7]) + ink[7:], max(0.4, width * scale))
    size = drawn.letter * scale
    for (x, y), text, ink in drawn.words:
        if text in (CREDIT, SHORT_CREDIT):
            continue  # stands below
        left, base = (x + 0.5) * scale + corner[0], (y + 0.5 + 0.93 * drawn.letter) * scale + corner[1]
        if not inks:
            page.halo(left, base, text, size)
        page.text(left, base, text, size, inks.get(ink[:7], ink))


def _frame(page: Page, corner: tuple[float, float], width: float, height: float) -> None:
    x, y = corner
    page.line(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height], [x, y]]), "#000000", 0.8)


def _card(page: Page, title: str, lines: Sequence[str]) -> None:
    page.text(MARGIN, MARGIN + 16.0, title, 16.0)
    for k, line in enumerate(lines):
        page.text(MARGIN, MARGIN + 33.0 + 13.0 * k, line, 9.0, "#333333")


def _compass(page: Page, north: Floats, east: Floats) -> None:
    """Arrows in the card's right corner; ``north`` and ``east`` are directions (2,) on the page."""
    middle, length = np.array([page.width - MARGIN - 34.0, MARGIN + 34.0]), 20.0
    for way, letter in ((np.asarray(north), "N"), (np.asarray(east), "E")):
        tip, side = middle + length * way, np.array([-way[1], way[0]]) * 2.5
        back = middle + 0.72 * length * way
        page.line(np.array([middle, tip]), "#000000", 1.0)
        page.line(np.array([tip, back + side, back - side, tip]), "#000000", 1.0)
        x, y = middle + 1.4 * length * way
        page.text(float(x) - 3.0, float(y) + 3.3, letter, 9.0)


def _legend(page: Page, sheet: Solution, scale: float, chart: bool, faintest: float) -> None:
    """A scale of a round length, what the colours are, sizes of stars, and the credit."""
    y = page.height - MARGIN - 26.0
    arcmin_pt = sheet.camera.scale_arcsec_px / 60.0 / scale
    lengths = (0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1200)
    length = max((one for one in lengths if one / arcmin_pt < 150.0), default=lengths[0])
    end = MARGIN + length / arcmin_pt
    page.line(np.array([[MARGIN, y - 4.0], [MARGIN, y], [end, y], [end, y - 4.0]]), "#000000", 1.0)
    page.text(MARGIN + 4.0, y - 4.0, f"{length / 60:g}°" if length >= 60 else f"{length:g}′", 8.0)
    x = end + 24.0
    for ink, name in LEGENDS:
        colour = PRINTED[ink] if chart else INKS[ink]
        turn = np.linspace(0.0, 2.0 * np.pi, 25)
        ring = np.column_stack([x + 3.5 * np.cos(turn), y - 3.0 + 3.5 * np.sin(turn)])
        page.line(ring, colour, 1.2)
        page.text(x + 8.0, y, tr(name), 8.0)
        x += 18.0 + page.font.width(tr(name)) * 8.0
    for mag in range(math.floor(faintest), -2, -2) if chart else ():
        radius = min(FAINTEST_R + STEP_R * (faintest - mag), LARGEST_R)
        if x > page.width - MARGIN - 24.0 or radius >= LARGEST_R:
            break
        page.discs(np.array([[x + 4.0, y - 3.0]]), [radius], "#000000")
        page.text(x + 10.0, y, str(mag), 8.0)
        x += 26.0
    page.text(MARGIN, page.height - MARGIN - 6.0, CREDIT, 7.0, "#555555")
