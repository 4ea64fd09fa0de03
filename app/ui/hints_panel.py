"""The pane where a person says what they believe about the frame, and chooses the methods."""

from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QFormLayout, QHBoxLayout, QLineEdit, QVBoxLayout, QWidget

from app.core.errors import UsageError
from app.core.hint import Hint, Site
from app.solve.options import SolveOptions
from app.ui.angle_input import parse_dec_deg, parse_positive, parse_ra_deg, parse_site, site_text
from app.ui.method_group import MethodGroup
from app.ui.widgets import button, label

SPREAD = 0.2  # a typed field or scale is believed to within this much
NEAR_RADIUS_DEG = 10.0
LIMIT_S = "30"
SITE_TIP = (
    "Where you observe: degrees, north and east positive, and if you like the height in metres. "
    "With it the altitude and azimuth under the cursor are shown; it is kept, and never decides."
)
ADVICE = (
    "Nothing needs to be filled in. A hint makes a solve faster; a wrong one costs time, not the "
    "answer."
)


@dataclass(frozen=True, slots=True)
class Beliefs:
    """What was typed, understood."""

    fov_deg: float | None = None
    scale_arcsec_px: float | None = None
    centre_deg: tuple[float, float, float] | None = None

    def hint(self, width_px: int) -> Hint | None:
        """As a hint for a frame ``width_px`` wide; None when nothing was said."""
        scale = self.scale_arcsec_px
        if scale is None and self.fov_deg is not None and width_px > 0:
            focal_px = width_px / 2.0 / np.tan(np.radians(self.fov_deg) / 2.0)
            scale = float(np.degrees(1.0 / focal_px) * 3600.0)
        if scale is None and self.centre_deg is None:
            return None
        span = None if scale is None else (scale * (1 - SPREAD), scale * (1 + SPREAD))
        return Hint(scale_arcsec_px=span, centre_deg=self.centre_deg, source="typed")


class HintsPanel(QWidget):
    """Every field may stay empty: hints save time and never decide."""

    solve_wanted = Signal()
    site_given = Signal(object)  # app.core.hint.Site, or None

    def __init__(self, methods: list[str], detectors: list[str]) -> None:
        super().__init__()
        self.setObjectName("page")
        self.fov = self._field("Field width in degrees", "for example 1.2")
        self.scale = self._field("Pixel scale in arcseconds a pixel", "for example 3.6")
        self.ra = self._field("Near right ascension", "5h35m17s or 83.82")
        self.dec = self._field("Near declination", "-5d23m or -5.39")
        self.radius = self._field("Within so many degrees", f"{NEAR_RADIUS_DEG:g} when empty")
        self.timeout = self._field("Time limit in seconds", "no limit when empty")
        self.timeout.setText(LIMIT_S)
        self.site = self._field("Your site", "48.14, 11.58: latitude, longitude")
        self.site.setToolTip(SITE_TIP)
        self.site.editingFinished.connect(self._site_typed)
        self.methods = MethodGroup(methods, detectors)
        self.method, self.detector = self.methods.method, self.methods.detector
        self.header = QCheckBox("&Believe what the file says of itself first")
        self.header.setChecked(True)
        self.wrong = label("", "wrong", wrap=True)
        self.wrong.setVisible(False)
        self._layout()

    def _layout(self) -> None:
        form = QFormLayout()
        form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        form.setHorizontalSpacing(12)
        form.setVerticalSpacing(8)
        for title, widget in (
            ("Field &width, °", self.fov), ("&Pixel scale, ″", self.scale), ("RA &near", self.ra),
            ("&Dec near", self.dec), ("With&in, °", self.radius), ("Time &limit, s", self.timeout),
            ("&Your site", self.site),
        ):  # fmt: skip
            form.addRow(title, widget)
        line = QHBoxLayout()
        line.addWidget(button("S&olve with these", self.solve_wanted.emit, "main"))
        line.addWidget(button("Clea&r", self.clear))
        line.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 12, 12, 12)
        column.setSpacing(10)
        column.addWidget(label(ADVICE, "muted", wrap=True))
        column.addLayout(form)
        column.addWidget(self.header)
        column.addWidget(self.wrong)
        column.addLayout(line)
        column.addWidget(self.methods)
        column.addStretch(1)

    def options(self, width_px: int) -> SolveOptions:
        """What was typed, for a frame ``width_px`` wide; UsageError says what is wrong."""
        timeout = self.timeout.text().strip()
        return SolveOptions(
            **self.methods.choices(),
            hint=self.beliefs().hint(width_px),
            use_header=self.header.isChecked(),
            timeout_s=parse_positive(timeout, "The time limit", 86400.0) if timeout else None,
        )

    def show_site(self, site: Site | None) -> None:
        """Where the person observes, as far as is known."""
        self.site.setText(site_text(site) if site is not None else "")

    def _site_typed(self) -> None:
        text = self.site.text().strip()
        try:
            self.site_given.emit(parse_site(text) if text else None)
            self.wrong.setVisible(False)
        except UsageError as error:
            self.wrong.setText(str(error))
            self.wrong.setVisible(True)

    def checked_options(self, width_px: int) -> SolveOptions | None:
        """The same, or None with the fault shown on the pane."""
        try:
            options = self.options(width_px)
        except UsageError as error:
            self.wrong.setText(str(error))
            self.wrong.setVisible(True)
            return None
        self.wrong.setVisible(False)
        return options

    def beliefs(self) -> Beliefs:
        """What was typed about the sky."""
        fov, scale = self.fov.text().strip(), self.scale.text().strip()
        ra, dec, radius = (w.text().strip() for w in (self.ra, self.dec, self.radius))
        centre = None
        if ra or dec:
            if not (ra and dec):
                raise UsageError("A place needs both right ascension and declination.")
            within = parse_positive(radius, "The radius", 180.0) if radius else NEAR_RADIUS_DEG
            centre = (parse_ra_deg(ra), parse_dec_deg(dec), within)
        return Beliefs(
            parse_positive(fov, "The field width", 170.0) if fov else None,
            parse_positive(scale, "The pixel scale", 3600.0) if scale else None,
            centre,
        )

    def clear(self) -> None:
        """Forget what was typed and chosen, but for the site, which is kept across starts."""
        for field in (self.fov, self.scale, self.ra, self.dec, self.radius):
            field.clear()
        self.timeout.setText(LIMIT_S)
        self.header.setChecked(True)
        self.methods.reset()
        self.wrong.setVisible(False)

    def _field(self, name: str, example: str) -> QLineEdit:
        field = QLineEdit()
        field.setPlaceholderText(example)
        field.setAccessibleName(name)
        field.setToolTip(f"{name}: {example}")
        field.returnPressed.connect(self.solve_wanted)
        return field
