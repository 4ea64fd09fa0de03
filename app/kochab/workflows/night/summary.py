"""The night as a whole: light lost, focus, tilt, drift, the best and the worst frames, and one piece of advice."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import datetime

import numpy as np

from kochab.core.attitude import cross_product, unit_vectors
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.core.values import frozen
from kochab.polar.drift import Drift, measure_drift, stretches_of
from kochab.polar.error import Knob, angle_in_words
from kochab.polar.measure import MeasureSettings
from kochab.polar.pole import pole_direction
from kochab.sky.horizon import Horizon
from kochab.sky.solar_system import covers
from kochab.text.translation import number, tr, tr_n
from kochab.workflows.night.crossings import Crossing, not_repeated
from kochab.workflows.night.events import Event, events_of
from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.guiding import Guiding
from kochab.workflows.night.light_curve import LightCurve, light_curves
from kochab.workflows.night.measure import Measure, median_of, slope
from kochab.workflows.night.pointing import NO_POINTING, NightPointing, pointing_of
from kochab.workflows.night.sharpness import WIDTH_SHARE, FieldOfSharpness, night_field
from kochab.workflows.night.sky_brightness import MAG_PER_AIRMASS, DarkLevel, blacks_of, brightness_of, faintest_of
from kochab.workflows.night.strangers import Stranger, strangers_of
from kochab.workflows.night.tracking import FEWEST, POLAR_ARCSEC, Place, Tracking, tracking_of
from kochab.workflows.night.transparency import losses

FRAME_MAG = 0.01
"""One sigma of what a frame's star images take from all its stars alike: trails, focus, what the fit leaves out."""
CLOUD_MAG, SURE = 0.3, 3.0
"""Light lost beside the airmass that counts as cloud, and times its uncertainty."""
SHOWN = 3
"""Best and worst frames."""
TILTED, TRAILED, DEFOCUSED = 0.15, 0.15, 0.15
"""Shares of the FWHM, of the axes and of the FWHM from which advice is given."""
NO_TILT = 1e-6
"""The chance below which a tilt is one: a frame has many stars, and optics are never perfect."""
SAMPLED_PX = 1.8
"""FWHM below which the shape of stars says nothing of optics or guiding: a pixel is too coarse."""
FAR_ARCSEC = 300.0
"""Of the polar axis, beyond which it is worth an evening's first minutes."""
LONGEST_H = 20.0
"""No night is longer, but a polar one."""
TELLING = 3
"""Frames from which on a mast or a wire would return."""
CLOUDED = 0.15
"""Share of the frames."""


@frozen(eq=False)
class Night:
    """Frames in order of time, and what they say together.

    ``lost`` is light against the clear frames, magnitudes; ``cloud`` the same without what airmass takes. ``fwhm`` is
    the median of the frames, px; ``focus`` its change an hour, px.
    ``crossings`` are streaks, each with the frame it is in; ``strangers`` what stood among the stars and is none.
    ``brightness`` of the sky is mag/arcsec², ``faintest`` the magnitude of a star at a signal to noise of 5.
    ``polar`` is the axis by drift, ``pointing`` the model by the headers' places. ``asked`` is how many frames there
    are to measure.
    """

    frames: tuple[NightFrame, ...]
    lost: tuple[Measure | None, ...]
    cloud: tuple[Measure | None, ...]
    fwhm: Measure | None
    elongation: Measure | None
    focus: Measure | None
    shape: FieldOfSharpness | None
    tracking: tuple[Tracking, ...]
    polar: Drift | None
    asked: int
    crossings: tuple[tuple[int, Crossing], ...] = ()
    strangers: tuple[Stranger, ...] = ()
    brightness: tuple[Measure | None, ...] = ()
    faintest: tuple[Measure | None, ...] = ()
    guiding: tuple[Guiding, ...] = ()
    light_curves: tuple[LightCurve, ...] = ()
    pointing: NightPointing = NO_POINTING

    @property
    def events(self) -> tuple[Event, ...]:
        """What happened, in order of time."""
        passed = [(self.frames[k].time_utc, one) for k, one in self.crossings]
        return events_of(self.tracking, [(time, one) for time, one in passed if time])

    @property
    def clouded(self) -> list[int]:
        """Frames that lost light to more than airmass."""
        return [k for k, one in enumerate(self.cloud) if one and one.value > CLOUD_MAG and one.sigmas > SURE]

    def usual(self, values: "Sequence[Measure | None]") -> Measure | None:
        """The median of what the frames have, with what they all may be off by; None where none has it."""
        known = [one for one in values if one]
        found = _median(known)
        return found and Measure(found.value, max(found.sigma, min(one.sigma for one in known)))

    @property
    def unsolved(self) -> list[int]:
        """Frames without a solution, or that could not be read."""
        return [k for k, frame in enumerate(self.frames) if not frame.solved]

    @property
    def untracked(self) -> bool:
        """Whether the mount stood still: stars then trail more at lower declination, which looks like tilt."""
        return any(one.untracked for one in self.tracking)

    @property
    def field(self) -> FieldOfSharpness | None:
        """Sharpness over the field; None where trails look like it."""
        return None if self.untracked else self.shape

    @property
    def tilt(self) -> Measure | None:
        """What the field shows of it, px."""
        return self.field.tilt if self.field else None

    @property
    def hours(self) -> float:
        """From the first to the last frame with a time."""
        times = [frame.time_utc for frame in self.frames if frame.time_utc]
        return (max(times) - min(times)).total_seconds() / 3600.0 if times else 0.0

    @property
    def ranked(self) -> list[int]:
        """Frames from the best to the worst: light by the area it is spread over; those without a solution last."""

        def quality(k: int) -> tuple[bool, float]:
            frame, lost = self.frames[k], self.lost[k]
            if frame.sharp is None:
                return False, -1.0
            light = 10.0 ** (-0.4 * (lost.value if lost else 0.0))
            return frame.solved, light / (frame.sharp.fwhm_px.value**2 * frame.sharp.elongation.value)

        return sorted(range(len(self.frames)), key=quality, reverse=True)

    @property
    def best(self) -> list[int]:
        """The best frames, none that is among the worst."""
        return [k for k in self.ranked[: min(SHOWN, len(self.frames) // 2)] if self.frames[k].solved]

    @property
    def worst(self) -> list[int]:
        """The worst frames, the worst first."""
        return self.ranked[::-1][: min(SHOWN, len(self.frames) // 2)]


def night_of(frames: Sequence[NightFrame], asked: int | None = None, guiding: Sequence[Guiding] = ()) -> Night:
    """Put frames together; ``asked`` is how many there are when not all were measured. Calibration is left out."""
    asked = (len(frames) if asked is None else asked) - sum(frame.calibration for frame in frames)
    darks = [frame.dark for frame in frames if frame.dark]
    frames = [frame for frame in frames if not frame.calibration]
    ordered = sorted(frames, key=lambda f: (f.time_utc is None, f.time_utc.timestamp() if f.time_utc else 0.0, f.file))
    lost = _lost(ordered)
    cloud = _cloud(ordered, lost)
    # The shape of the field is that of the camera most frames are of.
    usual = Counter((f.size, f.setup) for f in ordered if f.sharp).most_common(1)
    fields = [f.sharp.field for f in ordered if f.sharp and f.sharp.field and (f.size, f.setup) == usual[0][0]]
    polar = _polar(ordered)
    return Night(
        tuple(ordered),
        tuple(lost),
        tuple(cloud),
        _of_scale(_median([f.sharp.fwhm_px for f in ordered if f.sharp])),
        _median([f.sharp.elongation for f in ordered if f.sharp]),
        _focus(ordered),
        night_field(fields),
        tuple(tracking_of(list(_places(ordered)), polar.error.total_arcsec if polar and polar.known else POLAR_ARCSEC)),
        polar,
        asked,
        tuple(_crossings(ordered)),
        strangers_of([f.sights for f in ordered], [f.time_utc for f in ordered]),
        tuple(_brightness(ordered, cloud, darks)),
        tuple(faintest_of(f.on_sky) if f.on_sky else None for f in ordered),
        tuple(guiding),
        light_curves(ordered),
        pointing_of(ordered),
    )


def _brightness(
    frames: Sequence[NightFrame], cloud: Sequence[Measure | None], darks: Sequence[DarkLevel]
) -> Iterator[Measure | None]:
    """Of the sky in each frame, where its black level is known."""
    stars = [f.on_sky for f in frames]
    blacks = blacks_of(stars, [f.exposure_s for f in frames], [f.time_utc for f in frames], darks)
    for f, black, lost in zip(frames, blacks, cloud, strict=True):
        if f.on_sky is None or black is None:
            yield None
        else:
            yield brightness_of(f.on_sky, black, f.sky.airmass if f.sky else None, lost)


def _places(frames: Sequence[NightFrame]) -> Iterator[Place]:
    """Where the frames pointed, and how far the RA axis fell behind, turned about the refracted pole."""
    began: dict[Site, tuple[datetime, float]] = {}
    for f in frames:
        if not (f.solved and f.time_utc):
            continue
        axis = math.nan
        if f.site and covers(f.time_utc):
            hour = _hour_rad(f.ra_deg, f.dec_deg, f.site, f.time_utc)
            start, first = began.setdefault(f.site, (f.time_utc, hour))
            turned = SIDEREAL_RAD_S * (f.time_utc - start).total_seconds()
            axis = math.degrees((turned - (hour - first) + math.pi) % (2.0 * math.pi) - math.pi) * 3600.0
        yield Place(f.time_utc, f.ra_deg, f.dec_deg, f.width_deg, f.roll_deg, axis, f.exposure_s or 0.0, f.reported_deg)


def _hour_rad(ra_deg: float, dec_deg: float, site: Site, time_utc: datetime) -> float:
    """Hour angle about the refracted pole, west positive, of where a place is seen through the air."""
    seen = Horizon(site, time_utc).observed(unit_vectors(ra_deg, dec_deg)[None])[0]
    pole = pole_direction(site)
    north = 1.0 if site.latitude_deg >= 0.0 else -1.0
    west = np.array([-1.0, 0.0, 0.0])
    meridian = north * cross_product(pole, west)
    return math.atan2(float(seen @ west), float(seen @ meridian))


def _crossings(frames: Sequence[NightFrame]) -> Iterator[tuple[int, Crossing]]:
    """Streaks that are not in several frames at one place; of few frames, in which a mast is like them, named ones."""
    alone = sum(frame.solved for frame in frames) < TELLING
    kept = not_repeated(
        [f.crossings for f in frames],
        max((f.size[0] for f in frames), default=0),
        [f.time_utc for f in frames],
        [f.exposure_s for f in frames],
    )
    return ((k, one) for k, found in enumerate(kept) for one in found if one.name or not alone)


def _median(values: list[Measure]) -> Measure | None:
    """Of the frames: their median, or of one or two the mean with its own uncertainty."""
    if not values:
        return None
    middle = median_of(np.array([one.value for one in values]))
    own = float(np.mean([one.sigma for one in values])) / np.sqrt(len(values))
    value = middle.value if middle else float(np.mean([one.value for one in values]))
    return Measure(value, max(middle.sigma if middle else 0.0, own))


def _of_scale(width: Measure | None) -> Measure | None:
    """A width with what all widths share."""
    return Measure(width.value, math.hypot(width.sigma, WIDTH_SHARE * width.value)) if width else None


def _lost(frames: Sequence[NightFrame]) -> list[Measure | None]:
    """Light lost: among frames of one setup that are proportional to light, and whose exposure is known alike."""
    found: list[Measure | None] = [None] * len(frames)
    setups = {(frame.setup, frame.size, frame.exposure_s is None) for frame in frames if frame.light is not None}
    for setup in setups:
        same = [
            (k, frame.light)
            for k, frame in enumerate(frames)
            if frame.light is not None and (frame.setup, frame.size, frame.exposure_s is None) == setup
        ]
        if len(same) < 2:
            continue
        for (k, _), one in zip(same, losses([light for _, light in same]), strict=True):
            found[k] = Measure(one.value, math.hypot(one.sigma, FRAME_MAG)) if one else None
    return found


def _cloud(frames: Sequence[NightFrame], lost: Sequence[Measure | None]) -> list[Measure | None]:
    """Light lost beside what airmass takes, where the altitude is known; half of that is its uncertainty."""
    air = [frame.sky.airmass if frame.sky else None for frame in frames]
    clear = {
        frame.setup: min((abs(one.value), k) for k, one in enumerate(lost) if one and frames[k].setup == frame.setup)[1]
        for frame, one in zip(frames, lost, strict=True)
        if one
    }
    found: list[Measure | None] = []
    for frame, one, here in zip(frames, lost, air, strict=True):
        there = air[clear[frame.setup]] if frame.setup in clear else None
        taken = MAG_PER_AIRMASS * (here - there) if here is not None and there is not None else 0.0
        found.append(Measure(one.value - taken, float(np.hypot(one.sigma, 0.5 * taken))) if one else None)
    return found


def _focus(frames: Sequence[NightFrame]) -> Measure | None:
    timed = [(f.time_utc, f.sharp.fwhm_px.value) for f in frames if f.time_utc and f.sharp]
    if len(timed) < 5:
        return None
    hours = np.array([(time - timed[0][0]).total_seconds() / 3600.0 for time, _ in timed])
    if hours[-1] > LONGEST_H:
        return None
    found = slope(hours, np.array([wide for _, wide in timed]))
    return found[0] if found else None


def _polar(frames: Sequence[NightFrame]) -> Drift | None:
    """The polar axis by drift, where the site is known and one of its bolts can be told."""
    held = [(frame.sighting, frame.site) for frame in frames if frame.sighting and frame.site]
    if len(held) < FEWEST:
        return None
    settings = MeasureSettings(next(site for _, site in held if site))
    stretches = stretches_of([sighting for sighting, _ in held if sighting], settings, None)
    found = measure_drift(stretches, settings)
    return found if isinstance(found, Drift) and not found.spoilt and any(map(found.tells, Knob)) else None


def advice_of(night: Night) -> str:
    """The one thing that would have made this night better, by what it cost."""
    if night.hours > LONGEST_H:
        return tr("These frames are of several nights. Give one night at a time.")
    costs = [*_of_the_sky(night), *_of_the_optics(night), *_of_the_mount(night), *_of_the_axis(night)]
    return max(costs)[1] if costs else tr("Nothing stands out. Keep doing this.")


def _of_the_sky(night: Night) -> Iterator[tuple[float, str]]:
    """Shares of the frames that were lost, and what to do."""
    total = max(len(night.frames), 1)
    if (n := len(night.clouded)) > CLOUDED * total:
        mag = number(CLOUD_MAG, ".1f")
        text = tr("{n} of {total} frames lost more than {mag} mag to cloud. Leave them out.", n=n, total=total, mag=mag)
        yield n / total, text
    if (n := len(night.unsolved)) > CLOUDED * total:
        why = Counter(f.reason for f in night.frames if f.reason).most_common(1)
        reason = tr(why[0][0]) if why else tr("cannot be read")
        yield n / total, tr("{n} of {total} frames have no solution: {reason}.", n=n, total=total, reason=reason)


def _of_the_mount(night: Night) -> Iterator[tuple[float, str]]:
    """A clutch that slips costs the frames until somebody sees it; here a tenth of the night for each time."""
    knocks = [jump for one in night.tracking for jump in one.knocks]
    if knocks:
        worst = max(knocks, key=lambda jump: jump.size.value)
        when = f"{worst.time_utc:%H:%M}"
        text = tr("The field jumped by {far} at {time} UTC.", far=angle_in_words(worst.size.value), time=when)
        check = tr("Tighten the {axis} clutch.", axis=worst.axis) if worst.axis else tr("Tighten both clutches.")
        yield min(0.2 + 0.1 * len(knocks), 0.6), f"{text} {check}"


def _of_the_axis(night: Night) -> Iterator[tuple[float, str]]:
    """What the polar axis costs: a tenth for each 10 arcmin."""
    if night.polar and night.polar.known:
        error = night.polar.error
        off = error.total_arcsec
        if off > FAR_ARCSEC and off > SURE * error.with_systematics.sigma_total_arcsec:
            text = tr("The polar axis is off by {angle}. Align it before the next night.", angle=night.polar.words)
            yield min(off / 6000.0, 0.5), text


def _of_the_optics(night: Night) -> Iterator[tuple[float, str]]:
    """Shares by which stars are larger than they had to be, and what to do."""
    if night.untracked:
        yield 1.0, tr("The mount did not track: the field moved with the sky. Switch tracking on.")
        return
    if night.fwhm is None or night.fwhm.value < SAMPLED_PX:
        return
    shape = night.shape
    if shape and shape.tilt.value > TILTED * night.fwhm.value and shape.tilt_chance < NO_TILT:
        text = tr(
            "Stars get softer towards the {corner}: {tilt} px wider than opposite. Check for sensor tilt.",
            corner=tr(shape.softest),
            tilt=shape.tilt.text(),
        )
        yield shape.tilt.value / night.fwhm.value / 2.0, text
    trail = _median([f.sharp.trail for f in night.frames if f.sharp])
    if trail and trail.value > TRAILED and trail.sigmas > SURE:
        share = number(100.0 * trail.value, ".0f")
        text = tr("Stars are {share} % longer than wide all over the frame. Check guiding and balance.", share=share)
        yield trail.value, text
    grown = night.focus.value * night.hours / night.fwhm.value if night.focus else 0.0
    if night.focus and night.focus.sigmas > SURE and grown > DEFOCUSED:
        minutes = max(round(60.0 * 0.1 * night.fwhm.value / night.focus.value), 1)
        text = tr(
            "FWHM grew by {rate} px an hour. Refocus every {minutes}.",
            rate=night.focus.text(),
            minutes=tr_n("{n} minute", "{n} minutes", minutes),
        )
        yield grown / 2.0, text
