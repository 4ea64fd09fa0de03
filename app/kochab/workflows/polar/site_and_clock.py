"""What contradicts the site and the clock of frames, and what rests on them alone.

The sky looks the same from everywhere at some time: a wrong longitude or clock turns the axis about the pole, a
latitude of the wrong sign turns its altitude error round, and no star shows it. What may show it is outside the stars:
the Sun, the frames' own headers, the time zone, and frames that would look at the ground.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kochab.core.attitude import ARCSEC, angle_between, unit_vectors, wrapped
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S
from kochab.core.solution import Solution
from kochab.core.values import frozen
from kochab.frames.hints import NO_ZONE
from kochab.polar.error import CHI2_68, PolarError, angle_in_words
from kochab.polar.measure import PolarFinding, PolarFindingKind, axis_shift_arcsec
from kochab.polar.rotations import alt_az, direction
from kochab.sky.horizon import Horizon, sun_altitude_deg
from kochab.text.translation import number, tr, tr_noop
from kochab.workflows.polar.sources import SAME_SITE_DEG, SolvedFile

CLOCK_S, DAYS_S = 120.0, 130_000.0  # clocks that differ by less agree; frames older than that are played again


def doubts_of(
    files: Sequence[SolvedFile], error: PolarError, site: Site, site_given: bool, zone_given: bool
) -> list[PolarFinding]:
    """What the frames' headers may mean otherwise, and would move the axis past its ellipse.

    Parameters
    ----------
    files : Sequence[SolvedFile]
        The solved frames and what their headers say.
    error : PolarError
        The polar error that they give.
    site : Site
        Taken for them.
    site_given : bool
        Whether a person gave the site.
    zone_given : bool
        Whether a person gave the clock's UTC offset.
    """
    doubts = []
    unsigned = "" if site_given else next((file.unsigned for file in files if file.unsigned), "")
    west = replace(site, longitude_deg=-site.longitude_deg)
    if unsigned and axis_shift_arcsec(error, site, 2.0 * site.longitude_deg) and _up_at(files, west):
        text = tr(
            "The longitude in the header, {longitude}, has no sign. Say whether it is east or west: give the site.",
            longitude=unsigned,
        )
        doubts.append(PolarFinding(PolarFindingKind.LONGITUDE_SIGN, text, spoils=True))
    hour = 3600.0 * SIDEREAL_DEG_S
    times = [file.time_utc for file in files if file.time_utc is not None]
    astray = max(axis_shift_arcsec(error, site, sky) for sky in (-hour, hour)) if times and not zone_given else 0.0
    if astray and not horizon_agrees(files, site):
        unknown = any(NO_ZONE in file.warnings for file in files)
        says = (
            tr("The images have no time zone.")
            if unknown
            else tr("The frames' clock is taken as UTC ({time}).", time=f"{max(times):%H:%M}")
        )
        costs = tr("A one-hour clock error would shift the axis by {angle}: give the clock's UTC offset, 0 for UTC.")
        text = f"{says} {costs.format(angle=angle_in_words(astray))}"
        doubts.append(PolarFinding(PolarFindingKind.CLOCK, text, spoils=unknown))
    return doubts


LATEST_ZONE_H = 3.6  # of a zone from the Sun's own time: Kashgar and Pyongyang's summers are nearer
DEGREE = 1.0
UP_DEG = -1.0  # below, the brightest stars begin to show
# of a header's place over the horizon: J2000 taken for today, a long exposure's start; at the pole hours show less
AGREES_DEG, ELSEWHERE_DEG, TELLS_DEG = 0.75, 1.5, 75.0

BY_DAY = tr_noop(
    "The Sun would be up there at the time of {frame} ({high:.0f}° high). Check the site, its signs, the time and the"
    " time zone."
)
OTHER_SITE = tr_noop(
    "The frames say another site ({theirs}) than was given ({given}). The axis would be {angle} elsewhere: find out"
    " which is right."
)
OTHER_ZONE = tr_noop(
    "A clock {offset:+g} h from UTC does not fit the longitude, {longitude:+.0f}°. Check the signs of both (east is"
    " positive)."
)
OTHER_HORIZON = tr_noop(
    "The header of {frame} says altitude {theirs:.0f}°, azimuth {their_way:.0f}°; here and then it would be altitude"
    " {ours:.0f}°, azimuth {our_way:.0f}°. Check the site, its signs, the time and the time zone."
)
TRUSTED = tr_noop(
    "The frames can't show whether site and clock are right. One degree of longitude would shift the axis by {degree},"
    " one hour by {hour}: check both."
)
TRUSTED_SITE = tr_noop(
    "The frames can't show whether the site is right. One degree of longitude would shift the axis by {degree}:"
    " check it."
)
TRUSTED_CLOCK = tr_noop(
    "The frames can't show whether the clock is right. A one-hour clock error would shift the axis by {hour}: check it."
)
TRUSTED_NORTH = tr_noop(
    "The frames can't tell north from south. At latitude {latitude:+.1f}° they would be above the horizon by"
    " night as well, and the axis {angle} elsewhere: check the sign of the latitude."
)
TRUSTED_EAST = tr_noop(
    "The frames can't tell east from west. At longitude {longitude:+.1f}° they would be above the horizon by"
    " night as well, and the axis {angle} elsewhere: check the sign of the longitude."
)


def given_doubts(
    files: Sequence[SolvedFile], error: PolarError, site: Site, utc_offset_h: float | None, site_given: bool = True
) -> list[PolarFinding]:
    """What contradicts the site and the clock; where nothing does, what it would cost if they were wrong all the same.

    Parameters
    ----------
    files : Sequence[SolvedFile]
        The solved frames and what their headers say.
    error : PolarError
        The polar error that they give.
    site : Site
        Taken for them.
    utc_offset_h : float or None
        Given by a person; None where nobody vouched for the clock, which :func:`doubts_of` doubts.
    site_given : bool
        Whether a person gave the site.
    """
    theirs = next((file.site for file in files if file.site is not None), None)
    against = [*_by_day(files, site), *_other_horizon(files, error, site)]
    against += [*_other_site(error, site, theirs), *_other_zone(files, site, utc_offset_h)]
    if against:
        return against
    return [*_on_trust(files, error, site, utc_offset_h is not None, site_given, theirs is not None)]


def _by_day(files: Sequence[SolvedFile], site: Site) -> Iterator[PolarFinding]:
    high_deg, frame = max((sun_altitude_deg(site, f.time_utc), f.path) for f in files if f.time_utc is not None)
    if high_deg > UP_DEG:
        text = tr(BY_DAY, frame=Path(frame).name, high=high_deg)
        yield PolarFinding(PolarFindingKind.SITE_OR_TIME, text, spoils=True)


def _other_site(error: PolarError, site: Site, theirs: Site | None) -> Iterator[PolarFinding]:
    if theirs is not None and (angle := _apart_arcsec(error, site, theirs)):
        sites = [f"{number(s.latitude_deg, '.2f')}°, {number(s.longitude_deg, '.2f')}°" for s in (theirs, site)]
        text = tr(OTHER_SITE, theirs=sites[0], given=sites[1], angle=angle_in_words(angle))
        yield PolarFinding(PolarFindingKind.SITE_OR_TIME, text, spoils=True)


def _other_zone(files: Sequence[SolvedFile], site: Site, utc_offset_h: float | None) -> Iterator[PolarFinding]:
    """A zone that was said, or that the headers' local time shows, far from the Sun's own at the longitude."""
    zone_h = utc_offset_h or next((file.zone_h for file in files if file.zone_h), 0.0)
    if zone_h and abs(wrapped(15.0 * zone_h - site.longitude_deg)) > 15.0 * LATEST_ZONE_H:
        text = tr(OTHER_ZONE, offset=zone_h, longitude=site.longitude_deg)
        yield PolarFinding(PolarFindingKind.CLOCK, text, spoils=True)


def _other_horizon(files: Sequence[SolvedFile], error: PolarError, site: Site) -> Iterator[PolarFinding]:
    """A header whose place stands elsewhere over the horizon, by enough to move the axis."""
    seen = _horizons(files, site)
    if not seen:
        return
    worst = max(seen, key=lambda one: one.apart_deg)
    moved = max(axis_shift_arcsec(error, site, sky) for sky in (-worst.apart_deg, worst.apart_deg))
    if worst.apart_deg > ELSEWHERE_DEG and moved:
        (theirs, their_way), (ours, our_way) = worst.theirs_deg, worst.ours_deg
        frame = Path(worst.path).name
        text = tr(OTHER_HORIZON, frame=frame, theirs=theirs, their_way=their_way, ours=ours, our_way=our_way)
        yield PolarFinding(PolarFindingKind.SITE_OR_TIME, text, spoils=True)


def _on_trust(
    files: Sequence[SolvedFile],
    error: PolarError,
    site: Site,
    clock_given: bool,
    site_given: bool,
    site_in_headers: bool,
) -> Iterator[PolarFinding]:
    """What site and clock would move if they were wrong, where headers do not bear out what somebody gave.

    Moved is what may end outside the 95 % ellipse with the measurement's own error on top.
    """
    clock_known, twice = horizon_agrees(files, site), site_given and site_in_headers
    hour_deg = 3600.0 * SIDEREAL_DEG_S
    hour, degree = (
        0.0 if known else max(axis_shift_arcsec(error, site, sky, CHI2_68) for sky in (-turn, turn))
        for known, turn in ((clock_known or not clock_given, hour_deg), (twice, DEGREE))
    )
    if degree or hour:
        sentence = (TRUSTED if hour else TRUSTED_SITE) if degree else TRUSTED_CLOCK
        text = tr(sentence, degree=angle_in_words(degree), hour=angle_in_words(hour))
        yield PolarFinding(PolarFindingKind.ON_TRUST, text, unsettled=bool(hour) or site_given)
    if twice or clock_known:
        return
    south = replace(site, latitude_deg=-site.latitude_deg)
    over = _turned_over_arcsec(error)
    if over and _by_night_at(files, south):
        text = tr(TRUSTED_NORTH, latitude=south.latitude_deg, angle=angle_in_words(over))
        yield PolarFinding(PolarFindingKind.ON_TRUST, text, unsettled=site_given)
    west = replace(site, longitude_deg=-site.longitude_deg)
    around = axis_shift_arcsec(error, site, 2.0 * site.longitude_deg, CHI2_68)
    if around and _by_night_at(files, west):
        text = tr(TRUSTED_EAST, longitude=west.longitude_deg, angle=angle_in_words(around))
        yield PolarFinding(PolarFindingKind.ON_TRUST, text, unsettled=site_given)


def _turned_over_arcsec(error: PolarError) -> float:
    """How far the axis would be elsewhere, were the latitude's sign the other; 0 within its ellipse.

    The end of the axis that points to the other pole is as far from that to the other side: as much too low as it was
    too high, and to the same side by azimuth.
    """
    (up, _), (axis_up, axis_way) = alt_az(error.pole), alt_az(error.axis)
    there = direction(2.0 * up - axis_up, axis_way)
    return 0.0 if error.with_systematics.distance2(there) <= CHI2_68 else angle_between(there, error.axis) / ARCSEC


def _by_night_at(files: Sequence[SolvedFile], site: Site) -> bool:
    times = [file.time_utc for file in files if file.time_utc is not None]
    return _up_at(files, site) and all(sun_altitude_deg(site, time) < UP_DEG for time in times)


@frozen
class _Horizontal:
    """Where a header has its place over the horizon and where it stands from a site: altitude and azimuth, degrees."""

    path: str
    theirs_deg: tuple[float, float]
    ours_deg: tuple[float, float]
    apart_deg: float


def _horizons(files: Sequence[SolvedFile], site: Site) -> list[_Horizontal]:
    found = []
    for file in files:
        if file.aim is not None and file.time_utc is not None:
            ours = Horizon(site, file.time_utc).altaz_deg(unit_vectors(*file.aim.ra_dec_deg))
            there, here = (direction(*np.radians(each)) for each in (file.aim.altaz_deg, ours))
            apart_deg = float(np.degrees(angle_between(there, here)))
            found.append(_Horizontal(file.path, file.aim.altaz_deg, ours, apart_deg))
    return found


def horizon_agrees(files: Sequence[SolvedFile], site: Site) -> bool:
    """Whether headers have their places over the horizon where they stand from the site at the frames' times.

    They were reckoned with the capturing program's own site and clock: a zone, a sign or an hour that somebody got
    wrong shows, but near the pole.
    """
    seen = _horizons(files, site)
    aimed_deg = [abs(file.aim.ra_dec_deg[1]) for file in files if file.aim is not None]
    return bool(seen) and all(one.apart_deg < AGREES_DEG for one in seen) and min(aimed_deg) < TELLS_DEG


def _apart_arcsec(error: PolarError, site: Site, other: Site) -> float:
    """How far the axis would be elsewhere at the other site, 0 within its ellipse or at about the same site."""
    south = abs(other.latitude_deg - site.latitude_deg)
    east = wrapped(other.longitude_deg - site.longitude_deg)
    if max(south, abs(east)) < SAME_SITE_DEG:
        return 0.0
    # refraction apart, a site further south sees the same axis as far from its pole; across the equator another pole
    return 3600.0 * south if site.latitude_deg * other.latitude_deg < 0.0 else axis_shift_arcsec(error, site, east)


def clock_doubts(ahead_s: float, mount: str, error: PolarError, site: Site) -> list[PolarFinding]:
    """What the clocks of camera, mount and computer say against each other.

    Parameters
    ----------
    ahead_s : float
        How far the camera's is ahead of the computer's, seconds.
    mount : str
        What the mount's contradicts, a sentence; empty for nothing.
    error : PolarError
        The polar error.
    site : Site
        Where the mount stands.
    """
    found = [PolarFinding(PolarFindingKind.CLOCK, mount)] if mount else []
    apart_s = abs(ahead_s)
    astray = axis_shift_arcsec(error, site, ahead_s * SIDEREAL_DEG_S) if CLOCK_S < apart_s < DAYS_S else 0.0
    if astray:
        text = tr("The camera's clock is {size} ahead of this computer's. If it is wrong, the axis is off by {angle}.")
        if ahead_s < 0.0:
            text = tr(
                "The camera's clock is {size} behind this computer's. If it is wrong, the axis is off by {angle}."
            )
        hours, minutes = tr("{hours:.1f} h", hours=apart_s / 3600.0), tr("{minutes:.0f} min", minutes=apart_s / 60.0)
        size = hours if apart_s > 3500.0 else minutes
        found.append(PolarFinding(PolarFindingKind.CLOCK, text.format(size=size, angle=angle_in_words(astray))))
    return found


def _up_at(files: Sequence[SolvedFile], site: Site) -> bool:
    """Whether all frames look at the sky, and not at the ground, from there."""
    solved = [(f.result, f.time_utc) for f in files if isinstance(f.result, Solution) and f.time_utc is not None]
    return all(Horizon(site, time).altaz_deg(result.centre_vector)[0] > 0.0 for result, time in solved)
