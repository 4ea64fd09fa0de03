"""Recover a lost mount with nobody at the telescope, or diagnose why mount and sky disagree."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import datetime

from kochab.core.errors import DeviceError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Ability, SiteReport
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution, SolveNow, no_solution_text
from kochab.core.values import frozen
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Preview, SyncEvidence
from kochab.pointing.disagreement import Disagreement, MountSighting, investigate
from kochab.text.translation import tr, tr_noop
from kochab.workflows.fresh_frame import NoMoreFramesError
from kochab.workflows.goto_target import with_retries
from kochab.workflows.sync_mount import require_allowed, solves_apart_arcsec

FRAMES = 8
WHOLE_S = 1.0  # many cameras write whole seconds only
UNDATED = tr_noop(
    "The frame has no time (DATE-OBS or EXIF), so the telescope may have moved since. Let the camera "
    "write the time, and take a new frame."
)


@frozen
class Recovery:
    """What was done; degrees are ICRS.

    ``before_deg`` and ``after_deg`` are what the mount reported before and after the sync,
    ``sky_deg`` is where it really points. ``synced`` is False for a preview.
    """

    synced: bool
    before_deg: tuple[float, float]
    sky_deg: tuple[float, float]
    after_deg: tuple[float, float]
    preview: Preview
    evidence: SyncEvidence
    solution: Solution
    warnings: tuple[str, ...] = ()


def recover_mount(
    mount: Guard,
    solve_now: SolveNow,
    *,
    taken: Callable[[], datetime | None],
    confirmed: bool = False,
    allow_large_sync: bool = False,
    only_look: bool = False,
) -> Task[Recovery]:
    """Solve lost in space until two solves agree, sync within the guard, read it back.

    Nothing moves. Nobody may be there, so only frames taken after this began prove where the telescope points.

    Raises RefusedError when no two frames agree, a frame has no time or is too early, the guard forbids the sync, or
    the mount rejects it.

    Parameters
    ----------
    mount : Guard
        Behind its guard.
    solve_now : SolveNow
        Takes a frame and solves it.
    taken : Callable[[], datetime or None]
        Gives when the last solved frame was taken (UTC, mid-exposure), None when it has no time.
    confirmed : bool
        A person's yes to the larger step that the guard asks about and to an earlier frame.
    allow_large_sync : bool
        A person's yes to the largest step.
    only_look : bool
        Whether nothing is synced.
    """
    if Ability.SYNC in mount.lacks and not only_look:
        raise RefusedError(mount.lacks[Ability.SYNC])
    began = mount.clock()
    solutions, times = yield from _agreeing(mount, solve_now, taken)
    warnings = _from_before(began, mount.clock(), times, confirmed or allow_large_sync or only_look)
    age_s = [(mount.clock() - time).total_seconds() for time in times]
    state = with_retries(mount.state)
    drift_deg = age_s[-1] * SIDEREAL_DEG_S if state.tracking is False else 0.0
    if state.tracking is False:
        warnings.append(tr("The mount is not tracking: the sky drifts by 15″ per second."))
    evidence = _carried(SyncEvidence.of(*solutions), age_s if drift_deg else [0.0, 0.0])
    sky = evidence.centres_deg[-1]
    mount.allow_large_sync = allow_large_sync  # the guard takes it back after one sync
    yield Progress("sync", 0.8)
    before = with_retries(mount.position)
    there = mount.to_mount(*sky)
    preview = with_retries(lambda: mount.preview_sync(*there, evidence))
    if not only_look:
        require_allowed(mount, preview, confirmed or allow_large_sync)
        mount.sync(*there, evidence, confirmed=confirmed or allow_large_sync)
    now = mount.clock()
    before_deg, after_deg = from_mount_epoch(before, now), from_mount_epoch(with_retries(mount.position), now)
    warnings += preview.warnings
    return Recovery(not only_look, before_deg, sky, after_deg, preview, evidence, solutions[-1], tuple(warnings))


def _agreeing(
    mount: Guard, solve_now: SolveNow, taken: Callable[[], datetime | None]
) -> Task[tuple[list[Solution], list[datetime]]]:
    """Two solves in a row that agree, the younger one last, and when each frame was taken."""
    limit = mount.limits.solves_agree_arcsec
    before: tuple[Solution, datetime] | None = None
    why = ""
    for number in range(FRAMES):
        yield Progress("solving", number / FRAMES, "lost in space")
        try:
            found = yield from solve_now()
        except NoMoreFramesError:
            why = why or tr("Take a second frame.")
            break
        if isinstance(found, NoSolution):
            why = no_solution_text(found)
            continue
        when = taken()
        if when is None:
            raise RefusedError(UNDATED)
        if before is not None:
            if solves_apart_arcsec(before[0], found) <= limit:
                pair = sorted([before, (found, when)], key=lambda one: one[1])  # files of a folder come newest first
                return [one for one, _ in pair], [time for _, time in pair]
            why = tr("The frames show different places: the telescope is moving.")
        before = found, when
    text = tr("No two frames agree on where the telescope points.")
    raise RefusedError(f"{text} {why}".strip())


def _from_before(began: datetime, now: datetime, times: list[datetime], allowed: bool) -> list[str]:
    """A warning about frames taken before recover began; `RefusedError` unless allowed."""
    since, ahead = ((began - times[0]).total_seconds(), (times[-1] - now).total_seconds())
    if max(since, ahead) <= WHOLE_S:
        return []
    problem = (
        tr("The frame is dated {span} in the future: its clock or time zone is wrong", span=_span(ahead))
        if ahead > WHOLE_S
        else tr("The frame was taken {span} before recover began", span=_span(since))
    )
    if not allowed:
        raise RefusedError(
            "{problem}, so the telescope may have moved since. Take a new one now, or confirm (--yes) "
            "that it has not moved.",
            problem=problem,
        )
    return [tr("{problem}. The result holds only if the telescope has not moved since.", problem=problem)]


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 600.0 else f"{seconds / 3600.0:.1f} h"


def _carried(evidence: SyncEvidence, age_s: list[float]) -> SyncEvidence:
    """The centres now, of a telescope that does not track: the sky has turned since."""
    # A telescope that stands sees greater RA as the sky goes by.
    centres = tuple(
        ((ra + age * SIDEREAL_DEG_S) % 360.0, dec) for (ra, dec), age in zip(evidence.centres_deg, age_s, strict=True)
    )
    return replace(evidence, centres_deg=centres)


# -- Why the mount reports another position than the sky shows ---------------------------------


def sighted(
    mount: Guard, solution: Solution, time_utc: datetime | None = None, site: Site | None = None
) -> MountSighting:
    """A solve beside the position, time, site and state that the mount reports now.

    Parameters
    ----------
    mount : Guard
        Asked for them.
    solution : Solution
        Where the telescope points.
    time_utc : datetime or None
        When the frame was taken; None: now, by the guard's clock.
    site : Site or None
        Where the telescope stands; None: the guard's.
    """
    now = mount.clock()
    reported = with_retries(mount.position)
    state = with_retries(mount.state)
    report = SiteReport()
    with suppress(DeviceError):  # the diagnosis goes on without it
        report = mount.site_report()
    then = time_utc or now
    if report.time_utc is not None:  # the mount's clock as it was when the frame was taken
        report = replace(report, time_utc=report.time_utc + (then - now))
    place = site or mount.site
    reported_state = (state.pier_side, state.aligned, report, state.alt_azimuth)
    return MountSighting(solution.ra_dec_deg, reported, then, place, *reported_state)


def why_they_disagree(
    mount: Guard, solve_now: SolveNow, before: tuple[MountSighting, ...] = ()
) -> Task[tuple[Disagreement, tuple[MountSighting, ...]] | NoSolution]:
    """Solve a fresh frame and diagnose the cause; earlier sightings of tonight help."""
    yield Progress("solving")
    solved = yield from solve_now()
    if isinstance(solved, NoSolution):
        return solved
    yield Progress("reading the mount", 0.9)
    sightings = (*before, sighted(mount, solved))
    return investigate(sightings), sightings
