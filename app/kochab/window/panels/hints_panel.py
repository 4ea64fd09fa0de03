"""The tab with hints for a solve, and the choice of methods."""

from typing import Any

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFormLayout, QLineEdit

from kochab.core.errors import UsageError
from kochab.core.frame import Hint, Site
from kochab.parsing.angles import parse_dec_deg, parse_positive, parse_ra_deg, parse_site, site_text
from kochab.solver import SolveOptions
from kochab.text.translation import tr, tr_noop
from kochab.window.panels.method_options import MethodGroup
from kochab.window.widgets import (
    Page,
    button,
    column,
    field_values,
    fill_fields,
    form,
    label,
    row,
    show_text,
    switch,
    text_field,
)

SPREAD = 0.2  # either way of a typed field or scale: people read them off a lens or a label
NEAR_RADIUS_DEG = 10.0
LIMIT_S = "30"
SITE_TIP = tr_noop(
    "Latitude and longitude in degrees (north and east positive), and optionally the height in metres. "
    "Used to show altitude and azimuth under the cursor."
)
ADVICE = tr_noop("All optional. Hints speed up solving; a wrong hint only costs time.")


class HintsPanel(Page):
    """Fields for hints, all optional: they save time and never decide."""

    solve_wanted = Signal()
    clear_wanted = Signal()
    site_given = Signal(object)  # kochab.core.frame.Site, or None

    def __init__(self, methods: list[str], detectors: list[str]) -> None:
        super().__init__()
        self._fields = form()
        self._fields.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        self.fov = self._field(
            tr("Field &width, °"), tr("Field of view in degrees"), tr("e.g. {example}", example="1.2")
        )
        self.scale = self._field(
            tr("&Pixel scale, ″/px"), tr("Pixel scale in arcseconds per pixel"), tr("e.g. {example}", example="3.6")
        )
        self.ra = self._field(
            tr("RA &near"), tr("Right ascension"), tr("{one} or {other}", one="5h35m17s", other="83.82")
        )
        self.dec = self._field(tr("&Dec near"), tr("Declination"), tr("{one} or {other}", one="-5d23m", other="-5.39"))
        default = tr("default {radius:g}", radius=NEAR_RADIUS_DEG)
        self.radius = self._field(tr("Rad&ius, °"), tr("Search radius in degrees"), default)
        self.timeout = self._field(tr("Time &limit, s"), tr("Time limit in seconds"), tr("no limit if empty"))
        self.timeout.setText(LIMIT_S)
        self.site = self._field(tr("&Your site"), tr("Your site"), tr("48.14, 11.58: latitude, longitude"))
        self.site.setToolTip(tr(SITE_TIP))
        self.site.editingFinished.connect(self._site_typed)
        self.methods = MethodGroup(methods, detectors)
        self.method, self.detector = self.methods.method, self.methods.detector
        self.header = switch(tr("&Use the coordinates in the header first"))
        self.header.setChecked(True)
        self.wrong = label("", "wrong", wrap=True)
        self.wrong.setVisible(False)
        typed = (self.fov, self.scale, self.ra, self.dec, self.radius, self.timeout, self.header)
        chosen = (self.method, self.detector, self.methods.attitude)
        self._all = {str(at): field for at, field in enumerate((*typed, *chosen))}
        solve = button(tr("S&olve with these"), self.solve_wanted.emit, "main")
        clear = button(tr("Clea&r"), self.clear_wanted.emit)
        parts = (label(tr(ADVICE), "muted", wrap=True), self._fields, self.header, self.wrong, row(solve, clear, None))
        column(*parts, self.methods, None, on=self, spacing=10, margins=(12, 12, 12, 12))

    def options(self, width_px: int) -> SolveOptions:
        """For a frame ``width_px`` wide; UsageError says what is wrong."""
        timeout = self.timeout.text().strip()
        return SolveOptions(
            **self.methods.choices(),
            hint=self._hint(width_px),
            use_header=self.header.isChecked(),
            timeout_s=parse_positive(timeout, tr("The time limit"), 86400.0) if timeout else None,
        )

    def show_site(self, site: Site | None) -> None:
        self.site.setText(site_text(site) if site is not None else "")

    def _site_typed(self) -> None:
        text = self.site.text().strip()
        try:
            self.site_given.emit(parse_site(text) if text else None)
            show_text(self.wrong, "")
        except UsageError as error:
            show_text(self.wrong, str(error))

    def checked_options(self, width_px: int) -> SolveOptions | None:
        """The same, or None with the fault shown here."""
        options, wrong = None, ""
        try:
            options = self.options(width_px)
        except UsageError as error:
            wrong = str(error)
        show_text(self.wrong, wrong)
        return options

    def _hint(self, width_px: int) -> Hint | None:
        """What was typed, for a frame ``width_px`` wide; None when nothing was, UsageError when it is wrong."""
        typed = (self.fov, self.scale, self.ra, self.dec, self.radius)
        fov, scale, ra, dec, radius = (field.text().strip() for field in typed)
        centre = None
        if ra or dec:
            if not (ra and dec):
                raise UsageError("Enter both right ascension and declination.")
            within = parse_positive(radius, tr("The radius"), 180.0) if radius else NEAR_RADIUS_DEG
            centre = (parse_ra_deg(ra), parse_dec_deg(dec), within)
        fov_deg = parse_positive(fov, tr("The field of view"), 170.0) if fov else None
        scale_arcsec_px = parse_positive(scale, tr("The pixel scale"), 3600.0) if scale else None
        if scale_arcsec_px is None and fov_deg is not None and width_px > 0:
            # A lens without distortion: the scale at the frame's centre.
            focal_px = width_px / 2.0 / np.tan(np.radians(fov_deg) / 2.0)
            scale_arcsec_px = float(np.degrees(1.0 / focal_px) * 3600.0)
        if scale_arcsec_px is None and centre is None:
            return None
        span = None if scale_arcsec_px is None else (scale_arcsec_px * (1 - SPREAD), scale_arcsec_px * (1 + SPREAD))
        return Hint(scale_arcsec_px=span, centre_deg=centre, source="typed")

    def clear(self) -> None:
        """Back to the defaults; the site stays."""
        for field in (self.fov, self.scale, self.ra, self.dec, self.radius):
            field.clear()
        self.timeout.setText(LIMIT_S)
        self.header.setChecked(True)
        self.methods.reset()
        show_text(self.wrong, "")

    def typed(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """All that :meth:`clear` takes away, and the options of the method."""
        return field_values(self._all), field_values(self.methods.options.fields)

    def show_typed(self, typed: tuple[dict[str, Any], dict[str, Any]]) -> None:
        """What :meth:`typed` gave."""
        fill_fields(self._all, typed[0])
        fill_fields(self.methods.options.fields, typed[1])

    def _field(self, title: str, name: str, example: str) -> QLineEdit:
        """A field in the form, beside its title."""
        field = text_field(name, example, f"{name}: {example}")
        field.returnPressed.connect(self.solve_wanted)
        self._fields.addRow(title, field)
        return field
