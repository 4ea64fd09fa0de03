"""Earlier nights of one equipment and site: a line each in the user's folder, and how this night stands among them."""

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.robust import mad_sigma, median
from kochab.core.values import frozen
from kochab.folders import state_folder
from kochab.frames.atomic_file import write_atomically
from kochab.parsing.text_input import TextError, parse_json, read_text
from kochab.text.translation import tr_noop
from kochab.workflows.night.measure import Measure
from kochab.workflows.night.summary import Night

MOST_KEPT = 2000
LAST = 10
"""Nights that this one is compared with, the latest."""
FEWEST = 3
SITE_DEG = 0.1
"""Sites nearer than that are one."""
SCALE_SHARE = 0.03
"""Share by which the scale of one telescope and camera changes."""
UNUSUAL, LEAST_SHARE, LEAST_MAG = 3.0, 0.15, 0.15
"""Times the nights' scatter, and share of the usual value or magnitudes, from which a night is another one."""
QUANTITIES = {
    "fwhm_arcsec": tr_noop("FWHM (″)"),
    "elongation": tr_noop("Elongation"),
    "tilt_px": tr_noop("Tilt (px)"),
    "focus_px_h": tr_noop("Focus trend (px/h)"),
    "ra_arcsec_h": tr_noop("Drift in RA (″/h)"),
    "dec_arcsec_h": tr_noop("Drift in Dec (″/h)"),
    "periodic_arcsec": tr_noop("Periodic error (″)"),
    "polar_arcsec": tr_noop("Polar axis off by (″)"),
    "sky_mag_arcsec2": tr_noop("Sky (mag/arcsec²)"),
    "cloud_share": tr_noop("Frames in cloud (share)"),
}


@frozen
class NightRecord:
    """What is kept of a night: when it began (ISO, UTC), of what equipment, where (degrees or None), and its numbers.

    ``values`` are (value, sigma) by the names of `QUANTITIES`.
    """

    began: str
    equipment: str
    scale_arcsec_px: float
    site: tuple[float, float] | None
    values: dict[str, tuple[float, float]]

    def alike(self, other: "NightRecord") -> bool:
        """Whether both are of one equipment at one site."""
        near = abs(self.scale_arcsec_px / other.scale_arcsec_px - 1.0) < SCALE_SHARE
        if self.site is None or other.site is None:
            return near and self.equipment == other.equipment and self.site == other.site
        apart = max(abs(a - b) for a, b in zip(self.site, other.site, strict=True))
        return near and self.equipment == other.equipment and apart < SITE_DEG


@frozen
class Compared:
    """One quantity: tonight, the usual value with the scatter from night to night, and of how many nights."""

    name: str
    tonight: Measure
    usual: Measure
    nights: int

    @property
    def unusual(self) -> bool:
        """Whether this night differs by more than nights usually do, and by enough to matter."""
        off = abs(self.tonight.value - self.usual.value)
        wide = math.hypot(self.tonight.sigma, self.usual.sigma)
        least = LEAST_MAG if self.name == "sky_mag_arcsec2" else LEAST_SHARE * abs(self.usual.value)
        return off > max(UNUSUAL * wide, least)


def record_of(night: Night) -> NightRecord | None:
    """What is to be kept of a night; None where its frames have no time or no solution."""
    solved = [frame for frame in night.frames if frame.solved and frame.time_utc]
    if not solved:
        return None
    first = solved[0]
    assert first.time_utc is not None
    camera, size = Counter((frame.camera, frame.size) for frame in solved).most_common(1)[0][0]
    scale = median(np.array([frame.scale_arcsec_px for frame in solved]))
    where = next((frame.site for frame in solved if frame.site), None)
    site = (round(where.latitude_deg, 3), round(where.longitude_deg, 3)) if where else None
    values = {name: (one.value, one.sigma) for name, one in _values(night, scale) if math.isfinite(one.value)}
    return NightRecord(first.time_utc.isoformat(), f"{camera} {size[0]}x{size[1]}".strip(), scale, site, values)


def _values(night: Night, scale: float) -> Iterator[tuple[str, Measure]]:
    if night.fwhm:
        yield "fwhm_arcsec", Measure(night.fwhm.value * scale, night.fwhm.sigma * scale)
    if night.elongation:
        yield "elongation", night.elongation
    if night.tilt:
        yield "tilt_px", night.tilt
    if night.focus:
        yield "focus_px_h", night.focus
    if night.tracking:
        held = max(night.tracking, key=lambda one: len(one.frames))
        yield from ((name, one) for name, one in zip(("ra_arcsec_h", "dec_arcsec_h"), held.drifts, strict=True) if one)
        if held.periodic:
            yield "periodic_arcsec", held.periodic.amplitudes[0]
    if night.polar and night.polar.known:
        error = night.polar.error
        yield "polar_arcsec", Measure(error.total_arcsec, error.with_systematics.sigma_total_arcsec)
    if sky := night.usual(night.brightness):
        yield "sky_mag_arcsec2", sky
    if any(night.lost):
        yield "cloud_share", Measure(len(night.clouded) / len(night.frames), 0.0)


def store() -> Path:
    """Where the nights are kept."""
    return state_folder() / "nights.jsonl"


def kept_nights(path: Path | None = None) -> list[NightRecord]:
    """All that is kept, in order of time; what can't be read is left out."""
    path = path or store()
    try:
        lines = read_text(path).splitlines() if path.exists() else []
    except (TextError, OSError):
        return []
    found = [record for record in map(_read, lines) if record]
    return sorted(found, key=lambda one: one.began)


def _read(line: str) -> NightRecord | None:
    try:
        given = parse_json(line)
        site = given["site"]
        values = {name: (float(pair[0]), float(pair[1])) for name, pair in given["values"].items()}
        place = (float(site[0]), float(site[1])) if site else None
        scale = float(given["scale_arcsec_px"])
        whole = scale > 0.0 and math.isfinite(scale) and all(math.isfinite(v) for pair in values.values() for v in pair)
        return NightRecord(str(given["began"]), str(given["equipment"]), scale, place, values) if whole else None
    except (ValueError, LookupError, TypeError, AttributeError):
        return None


def keep_night(record: NightRecord, path: Path | None = None) -> None:
    """Add a night, in place of what was kept of the same one; nothing where the folder can't be written."""
    path = path or store()
    nights = [
        one for one in kept_nights(path) if (one.began[:10], one.equipment) != (record.began[:10], record.equipment)
    ]
    nights = sorted([*nights, record], key=lambda one: one.began)[-MOST_KEPT:]
    lines = [json.dumps(asdict(one), ensure_ascii=False) for one in nights]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, "\n".join(lines) + "\n")
    except OSError:
        return


def compared_with_earlier(night: Night, whole: bool = True) -> list[Compared]:
    """How a night compares with those that are kept; it is kept then for the next, where it is ``whole``."""
    record = record_of(night)
    if record is None:
        return []
    compared = against_earlier(record, kept_nights())
    if whole:
        keep_night(record)
    return compared


def against_earlier(record: NightRecord, kept: Sequence[NightRecord]) -> list[Compared]:
    """Tonight among the last nights of the same equipment and site; nothing of fewer than three."""
    others = [one for one in kept if one.alike(record) and one.began[:10] != record.began[:10]]
    others = [one for one in others if one.began < record.began][-LAST:] or others[:LAST]
    found = []
    for name in QUANTITIES:
        values = np.array([one.values[name][0] for one in others if name in one.values])
        if name not in record.values or len(values) < FEWEST:
            continue
        usual = Measure(median(values), _scatter(values))
        found.append(Compared(name, Measure(*record.values[name]), usual, len(values)))
    return found


def _scatter(values: Floats) -> float:
    """From night to night, wider for few of them."""
    return max(mad_sigma(values), float(values.std(ddof=1)) / 2.0) * math.sqrt(1.0 + 2.0 / len(values))
