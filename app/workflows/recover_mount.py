"""A robotic mount that has lost its place is told where it is, and nobody need be there."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime

from app.core.earth import SIDEREAL_DEG_S
from app.core.errors import RefusedError
from app.core.mount import Ability
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.mounts.epoch import from_mount_epoch
from app.mounts.guard import Guard
from app.mounts.limits import SyncEvidence
from app.mounts.preview import Preview
from app.workflows.fresh_frame import SolveNow
from app.workflows.goto_target import answered
from app.workflows.recover_frames import NoMoreFramesError
from app.workflows.sync_mount import hold_guard

LOOKS = 8
OLD_S = 600.0


@dataclass(frozen=True, slots=True)
class Recovery:
    """What was done; degrees are ICRS.

    ``before_deg`` and ``after_deg`` are the mount's word before and after the sync, ``sky_deg``
    where it really points. ``synced`` is False when only asked to look.
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
    confirmed: bool = False,
    armed: bool = False,
    only_look: bool = False,
    taken: Callable[[], datetime | None] = lambda: None,
) -> Task[Recovery]:
    """Solve lost in space until two solves agree, sync within the guard, read it back.

    Nothing moves. ``confirmed`` allows the larger step that the guard asks a yes for and a frame
    that is not of this minute, ``armed`` the largest. ``taken`` tells when the last solved frame
    was taken, if that may be a while ago.

    Raises
    ------
    RefusedError
        No two frames agree, the guard forbids the sync, or the mount does not take it.

    """
    if Ability.SYNC in mount.lacks and not only_look:
        raise RefusedError(mount.lacks[Ability.SYNC])
    solutions, age_s = yield from _agreeing(mount, solve_now, taken)
    warnings = _old(mount, age_s, confirmed or armed)
    state = answered(mount.state)
    drift_deg = age_s[-1] * SIDEREAL_DEG_S if state.tracking is False else 0.0
    if state.tracking is False:
        warnings.append("The mount does not track: the stars run past it by 15 arcsec a second.")
    evidence = _carried(SyncEvidence.of(*solutions), age_s if drift_deg else [0.0, 0.0])
    sky = evidence.centres_deg[-1]
    mount.armed = armed
    yield Progress("sync", 0.8)
    before = answered(mount.position)
    there = mount.to_mount(*sky)
    preview = answered(lambda: mount.preview_sync(*there, evidence))
    if not only_look:
        hold_guard(mount, preview, confirmed or armed)
        mount.sync(*there, evidence, confirmed=confirmed or armed)
    now = mount.clock()
    return Recovery(
        not only_look, from_mount_epoch(before, now), sky,
        from_mount_epoch(answered(mount.position), now), preview, evidence, solutions[-1],
        (*warnings, *preview.warnings),
    )  # fmt: skip


def _agreeing(
    mount: Guard, solve_now: SolveNow, taken: Callable[[], datetime | None]
) -> Task[tuple[list[Solution], list[float]]]:
    """Two solves in a row that agree, the younger one last, and how old each was, seconds."""
    from app.core.attitude import separation_deg, unit_vectors

    limit = mount.limits.solves_agree_arcsec
    before: tuple[Solution, float] | None = None
    why = ""
    for look in range(LOOKS):
        yield Progress("solving", look / LOOKS, "lost in space")
        try:
            found = yield from solve_now()
        except NoMoreFramesError:
            why = why or "A second frame is needed."
            break
        if isinstance(found, NoSolution):
            why = f"{found.reason[:1].upper()}{found.reason[1:]}: {found.advice}"
            continue
        when = taken()
        age = 0.0 if when is None else (mount.clock() - when).total_seconds()
        if before is not None:
            a, b = unit_vectors(*before[0].ra_dec_deg), unit_vectors(*found.ra_dec_deg)
            if separation_deg(a, b) * 3600.0 <= limit:
                pair = sorted([before, (found, age)], key=lambda one: -one[1])
                return [one for one, _ in pair], [seconds for _, seconds in pair]
            why = "The frames show different places: the telescope moves."
        before = found, age
    raise RefusedError(f"No two frames agree on where the telescope points. {why}".strip())


def _old(mount: Guard, age_s: list[float], confirmed: bool) -> list[str]:
    age = max(age_s, key=abs)
    if abs(age) <= OLD_S:
        return []
    told = f"{abs(age) / 3600.0:.1f} h {'ago' if age > 0 else 'in the future'}"
    if not confirmed:
        raise RefusedError(
            f"The frame was taken {told}, the telescope may have moved since: take a new one, or "
            "confirm that it has not."
        )
    return [f"The frame was taken {told}; it was confirmed that the telescope has not moved."]


def _carried(evidence: SyncEvidence, age_s: list[float]) -> SyncEvidence:
    """Where a telescope that does not track points now: the sky has turned past it."""
    centres = tuple(
        ((ra + age * SIDEREAL_DEG_S) % 360.0, dec)
        for (ra, dec), age in zip(evidence.centres_deg, age_s, strict=True)
    )
    return replace(evidence, centres_deg=centres)
