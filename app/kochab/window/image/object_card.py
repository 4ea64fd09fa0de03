"""The card of an object or a star of the frame: what it is, how bright and large, where, and how high tonight."""

from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtWidgets import QWidget

from kochab.core import number, tr, tr_noop
from kochab.core.angle_text import AngleStyle, radec_text
from kochab.core.arrays import Floats
from kochab.core.attitude import radec_deg
from kochab.core.solution import Solution
from kochab.sky.landmarks import constellation_at
from kochab.sky.layer import Mark
from kochab.sky.sky_tables import SkyTables
from kochab.sky.solar_system import AU_KM, BodyKind
from kochab.window.widgets import button, column, copy_text, label, row, styled_frame

if TYPE_CHECKING:
    from kochab.polar.horizon import Horizon

KINDS = {
    "G": tr_noop("Galaxy"),
    "GPair": tr_noop("Pair of galaxies"),
    "GTrpl": tr_noop("Triplet of galaxies"),
    "GGroup": tr_noop("Group of galaxies"),
    "GalCl": tr_noop("Cluster of galaxies"),
    "OCl": tr_noop("Open cluster"),
    "GCl": tr_noop("Globular cluster"),
    "*Ass": tr_noop("Association of stars"),
    "Cl+N": tr_noop("Cluster with nebula"),
    "DrkN": tr_noop("Dark nebula"),
    "RfN": tr_noop("Reflection nebula"),
    "EmN": tr_noop("Emission nebula"),
    "HII": tr_noop("Emission nebula"),
    "Neb": tr_noop("Nebula"),
    "PN": tr_noop("Planetary nebula"),
    "SNR": tr_noop("Supernova remnant"),
    "star": tr_noop("Star"),
}
TURN_H = 23.9344696  # of the sky
MARGIN_PX, LETTERS = 12, 44


def vector_of(tables: SkyTables, mark: Mark) -> Floats:
    """Its ICRS unit vector (3,): at J2000, a body's at the frame's time."""
    if mark.body is not None:
        return mark.body.vector
    return np.asarray((tables.stars if mark.kind == "star" else tables.objects).vector[mark.row])


def facts(
    tables: SkyTables, mark: Mark, solution: Solution, style: AngleStyle, horizon: "Horizon | None"
) -> dict[str, str]:
    """What the card tells, by title; ``horizon`` is the person's, now."""
    vector = vector_of(tables, mark)
    told = {
        "": tr(KINDS.get(mark.kind, mark.kind.capitalize() if mark.body else "")),
        tr("In"): constellation_at(vector),
    }
    told[tr("RA, Dec")] = radec_text(*radec_deg(vector), style)
    if mark.kind == "star":
        told["V"] = number(tables.stars.mag[mark.row], ".2f")
        hip = f"HIP {tables.stars.hip[mark.row]}"
        told[tr("Catalogue")] = hip
        residual = next((tr("{px:.2f} px", px=s.residual_px) for s in solution.stars if s.id == hip), "")
        told[tr("Residual")] = residual or tr("not matched")
    elif (body := mark.body) is not None:
        told |= {tr("Magnitude"): number(body.magnitude, ".1f")} if np.isfinite(body.magnitude) else {}
        told |= {tr("Diameter"): number(body.diameter_arcsec, ".3g") + "″"} if body.diameter_arcsec else {}
        near = body.kind is BodyKind.SPACECRAFT
        far = tr("{km:.0f} km", km=body.distance_au * AU_KM) if near else tr("{au:.4g} au", au=body.distance_au)
        told[tr("Distance")] = far
        return told  # heights of now would be those of where it was
    else:
        objects, k = tables.objects, mark.row
        names = [*objects.names(k)[1:], *str(objects.also[k]).split(",")]
        also = ", ".join(name for name in names if name and name not in mark.text)
        told |= {tr("Also"): also} if also else {}
        told |= {tr("Magnitude"): number(objects.mag[k], ".1f")} if np.isfinite(objects.mag[k]) else {}
        sides = [number(side, "g") + "′" for side in (objects.major[k], objects.minor[k]) if np.isfinite(side)]
        told |= {tr("Size"): " × ".join(sides)} if sides else {}
    if horizon is not None:
        told[tr("Now")], told[tr("Highest")] = heights(vector, horizon)
    return told


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

    def __init__(self, view: QWidget) -> None:
        super().__init__(view)
        self.title = label("", "strong", wrap=True)
        self.body = label("", wrap=True)
        self._frame = styled_frame("card")
        self._place = ""
        copy = button(tr("&Copy"), lambda: copy_text(self._place), "small", tr("Copy name and coordinates"))
        shut = button(tr("C&lose"), self.hide, "small")
        column(self.title, self.body, row(copy, shut, None), on=self._frame, spacing=8, margins=(12, 10, 12, 10))
        column(self._frame, on=self, margins=(0, 0, 0, 0))
        self.hide()

    def show_facts(self, name: str, told: dict[str, str]) -> None:
        """Tell what was picked."""
        self.title.setText(name)
        self.body.setText("\n".join(f"{title}  {text}".strip() for title, text in told.items()))
        self._place = "  ".join((name, told[tr("RA, Dec")]))
        self.show()
        width = self.fontMetrics().averageCharWidth() * LETTERS
        self.setGeometry(MARGIN_PX, MARGIN_PX, width, self._frame.heightForWidth(width))
