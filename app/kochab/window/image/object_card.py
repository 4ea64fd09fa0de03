"""An object, a star or a place of the frame: its card, with what it is and how high tonight, and its menu."""

import re
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QPoint, Signal
from PySide6.QtWidgets import QWidget

from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.solution import Solution
from kochab.sky.kinds import kind_in_words
from kochab.sky.landmarks import constellation_at
from kochab.sky.layer import Mark
from kochab.sky.sky_tables import SkyTables, Variable
from kochab.sky.solar_system import AU_KM, BodyKind
from kochab.text.angle_text import AngleStyle, arcsec_text, radec_text
from kochab.text.translation import number, tr, tr_noop
from kochab.window.widgets import button, column, copy_text, label, row, styled_frame

if TYPE_CHECKING:
    from kochab.sky.horizon import Horizon

VARIABLES = {
    "M": tr_noop("Mira star"),
    **dict.fromkeys(("SR", "SRA", "SRB", "SRC", "SRD", "SRS"), tr_noop("semiregular")),
    **dict.fromkeys(("L", "LB", "LC"), tr_noop("slow irregular")),
    **dict.fromkeys(("E", "EA", "EB", "EW"), tr_noop("eclipsing")),
    **dict.fromkeys(("CEP", "DCEP", "DCEPS", "CWA", "CWB"), tr_noop("Cepheid")),
    **dict.fromkeys(("RR", "RRAB", "RRC"), tr_noop("RR Lyrae star")),
    **dict.fromkeys(("DSCT", "DSCTC", "SXPHE"), tr_noop("Delta Scuti star")),
    **dict.fromkeys(("ACV", "ACVO", "SXARI", "BY", "FKCOM"), tr_noop("rotating")),
    **dict.fromkeys(("BE", "GCAS"), tr_noop("Be star")),
    **dict.fromkeys(("RV", "RVA", "RVB"), tr_noop("RV Tauri star")),
    "UV": tr_noop("flare star"),
    "ELL": tr_noop("ellipsoidal"),
}
"""The GCVS's types in words."""
TURN_H = 23.9344696  # of clock time to a turn of the sky: a sidereal day
MARGIN_PX, LETTERS = 12, 44


def vector_of(tables: SkyTables, mark: Mark, solution: Solution) -> Floats:
    """Its ICRS unit vector (3,): at J2000, that of a body or of a bare place at the frame's time."""
    if mark.body is not None:
        return mark.body.vector
    if not mark.kind:
        return np.asarray(solution.sky_at(mark.xy[None])[0])
    return np.asarray((tables.stars if mark.kind == "star" else tables.objects).vector[mark.row])


def facts(
    tables: SkyTables, mark: Mark, solution: Solution, style: AngleStyle, horizon: "Horizon | None"
) -> dict[str, str]:
    """What the card shows, by title.

    Parameters
    ----------
    tables : SkyTables
        Objects and named stars of the sky.
    mark : Mark
        What it is about.
    solution : Solution
        Of the frame.
    style : AngleStyle
        How coordinates are written.
    horizon : Horizon or None
        The person's, now; None: their site is not known.
    """
    vector = vector_of(tables, mark, solution)
    rows = {"": kind_in_words(mark.kind), tr("In"): constellation_at(vector)}
    rows[tr("RA, Dec")] = radec_text(*radec_deg(vector), style)
    if mark.kind == "star":
        rows["V"] = number(tables.stars.mag[mark.row], ".2f")
        away, pa_deg, mag = tables.stars.pair[mark.row].tolist()
        if np.isfinite(away):
            double = tr("{away:.1f}″ at {pa:.0f}°, {mag:.1f} mag (1991)", away=away, pa=pa_deg, mag=mag)
            rows[tr("Double")] = double
        if (varies := tables.variables.get(int(tables.stars.hip[mark.row]))) is not None:
            rows[tr("Variable")] = variable_text(varies)
        hip = f"HIP {tables.stars.hip[mark.row]}"
        rows[tr("Catalogue")] = hip
        if solution.stars:
            residual = next((tr("{px:.2f} px", px=s.residual_px) for s in solution.named if s.id == hip), "")
            rows[tr("Residual")] = residual or tr("not matched")
    elif (body := mark.body) is not None:
        rows |= {tr("Magnitude"): number(body.magnitude, ".1f")} if np.isfinite(body.magnitude) else {}
        rows |= {tr("Diameter"): number(body.diameter_arcsec, ".3g") + "″"} if body.diameter_arcsec else {}
        near = body.kind is BodyKind.SPACECRAFT
        far = tr("{km:.0f} km", km=body.distance_au * AU_KM) if near else tr("{au:.4g} au", au=body.distance_au)
        rows[tr("Distance")] = far
        rows |= {tr("Uncertainty (1σ)"): arcsec_text(body.sigma_arcsec)} if body.sigma_arcsec > 10.0 else {}
        return rows  # heights of now would be those of where it was
    else:
        objects, k = tables.objects, mark.row
        names = [*objects.names(k)[1:], *str(objects.also[k]).split(",")]
        also = ", ".join(name for name in names if name and name not in mark.text)
        rows |= {tr("Also"): also} if also else {}
        band = str(objects.band[k])
        if np.isfinite(objects.mag[k]) and band != "?":
            rows |= {band or tr("Magnitude"): number(objects.mag[k], ".1f")}
        sides = [number(side, "g") + "′" for side in (objects.major[k], objects.minor[k]) if np.isfinite(side)]
        rows |= {tr("Size"): " × ".join(sides)} if sides else {}
    if horizon is not None:
        rows[tr("Now")], rows[tr("Highest")] = heights(vector, horizon)
    return rows


def variable_text(star: Variable) -> str:
    """Its type in words, or as the GCVS writes it; between which magnitudes, and how fast."""
    plain = re.split(r"[/:+(]", star.kind)[0]
    variety = tr(VARIABLES.get(plain, "")) or tr("GCVS type {kind}", kind=star.kind or "?")
    # The decimal sign is a comma in some languages.
    low, high = (number(mag, ".2f").rstrip("0").rstrip(".,") for mag in (star.brightest, star.faintest))
    unknown = not np.isfinite(star.faintest)
    text = f"{variety}, {star.band} {low}" if unknown else f"{variety}, {star.band} {low}–{high}"
    return text + (tr(", period {days:.5g} d", days=star.period_d) if np.isfinite(star.period_d) else "")


def heights(vector: Floats, horizon: "Horizon") -> tuple[str, str]:
    """How high a place (3,) is at the horizon's time, and how high and when at its best, in the computer's time."""
    altitude, _ = horizon.altaz_deg(vector)
    latitude = np.radians(horizon.site.latitude_deg)
    east, north, up = horizon.observed(vector)[0]
    # On the meridian the hour angle, from the vector turned to the equator, is zero.
    hour = np.arctan2(-east, up * np.cos(latitude) - north * np.sin(latitude)) / (2.0 * np.pi) * TURN_H
    when = horizon.time_utc + timedelta(hours=float(-hour % TURN_H))
    best, _ = type(horizon)(horizon.site, when, horizon.refraction).altaz_deg(vector)
    now = tr("{altitude:.0f}° high", altitude=altitude) if altitude > 0.0 else tr("below the horizon")
    return now, tr("{best:.0f}° at {time}", best=best, time=_clock(when)) if best > 0.0 else tr("never rises")


def _clock(when: datetime) -> str:
    return when.astimezone().strftime("%H:%M")


class ObjectCard(QWidget):
    """Over the upper left of the image while something is picked."""

    menu_wanted = Signal(QPoint)

    def __init__(self, view: QWidget) -> None:
        super().__init__(view)
        self.title = label("", "strong", wrap=True)
        self.body = label("", wrap=True)
        self._frame = styled_frame("card")
        self._place = ""
        copy = button(tr("&Copy"), lambda: copy_text(self._place), "small", tr("Copy name and coordinates"))
        more = button(tr("&More"), lambda: self.menu_wanted.emit(more.mapToGlobal(more.rect().bottomLeft())), "small")
        shut = button(tr("C&lose"), self.hide, "small")
        column(self.title, self.body, row(copy, more, shut, None), on=self._frame, spacing=8, margins=(12, 10, 12, 10))
        column(self._frame, on=self, margins=(0, 0, 0, 0))
        self.hide()

    def show_facts(self, name: str, rows: dict[str, str]) -> None:
        """Tell what was picked."""
        self.title.setText(name)
        self.body.setText("\n".join(f"{title}  {text}".strip() for title, text in rows.items()))
        self._place = "  ".join((name, rows[tr("RA, Dec")]))
        self.show()
        width = self.fontMetrics().averageCharWidth() * LETTERS
        self.setGeometry(MARGIN_PX, MARGIN_PX, width, self._frame.heightForWidth(width))
