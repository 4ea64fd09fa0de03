"""The night's alignment as it went: measurements, what was seen while adjusting, every word."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from datetime import datetime
from typing import Any

from app.core.hint import Site
from app.polar.error import PolarError
from app.polar.measure import Measurement
from app.polar.poles import Pole

SPARSE_S = 2.0  # live errors are kept this far apart


@dataclass(frozen=True, slots=True)
class Entry:
    """One moment: ``kind`` is "measured", "live" or "told" (an instruction); angles in arcsec.

    ``sigma_arcsec`` (altitude, azimuth on the sky), ``sigma_total_arcsec`` and ``ellipse_arcsec``
    (long, short, angle in radians from azimuth to altitude; 68 %) have everything that may be
    wrong; ``noise_arcsec`` is the share of the frames' noise in the total's, ``unseen_arcsec``
    that of bending that no frame showed.
    """

    time_utc: datetime
    kind: str
    altitude_arcsec: float
    azimuth_arcsec: float
    azimuth_on_sky_arcsec: float
    total_arcsec: float
    sigma_arcsec: tuple[float, float]
    ellipse_arcsec: tuple[float, float, float]
    text: str = ""
    sigma_total_arcsec: float = 0.0
    noise_arcsec: float = 0.0
    unseen_arcsec: float = 0.0

    @classmethod
    def of(cls, time_utc: datetime, kind: str, error: PolarError, text: str = "") -> "Entry":
        """What an error says at a moment."""
        whole = error.whole
        return cls(
            time_utc, kind, error.altitude_arcsec, error.azimuth_arcsec,
            error.azimuth_on_sky_arcsec, error.total_arcsec, whole.sigma_arcsec,
            whole.ellipse_arcsec(), text, whole.sigma_total_arcsec, error.sigma_total_arcsec,
            error.unseen_along_arcsec,
        )  # fmt: skip


@dataclass(slots=True)
class History:
    """Grows while one alignment lasts."""

    site: Site | None = None
    pole: Pole = Pole.REFRACTED
    entries: list[Entry] = field(default_factory=list)

    def measured(self, measurement: Measurement) -> None:
        """Keep a measurement, with its findings."""
        self.site, self.pole = measurement.settings.site, measurement.settings.pole
        text = " ".join(finding.text for finding in measurement.findings)
        self.entries.append(Entry.of(measurement.time_utc, "measured", measurement.error, text))

    def live(self, time_utc: datetime, error: PolarError) -> None:
        """Keep an error seen while adjusting, when the last one kept is old enough."""
        last = next((e for e in reversed(self.entries) if e.kind == "live"), None)
        if last is None or abs((time_utc - last.time_utc).total_seconds()) >= SPARSE_S:
            self.entries.append(Entry.of(time_utc, "live", error))

    def told(self, time_utc: datetime, error: PolarError, text: str) -> None:
        """Keep an instruction."""
        self.entries.append(Entry.of(time_utc, "told", error, text))

    def of_kind(self, *kinds: str) -> Iterable[Entry]:
        """The entries of these kinds, in time's order."""
        return [entry for entry in self.entries if entry.kind in kinds]

    def as_json(self) -> str:
        """All of it, to be kept or compared."""
        whole: dict[str, Any] = {
            "site": None if self.site is None else asdict(self.site),
            "pole": str(self.pole),
            "entries": [
                asdict(entry) | {"time_utc": entry.time_utc.isoformat()} for entry in self.entries
            ],
        }
        return json.dumps(whole, indent=1)
