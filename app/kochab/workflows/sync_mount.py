"""Safe sync: two agreeing solves, the offset shown, the guard, the sync, reading it back, undo.

If the mount rejects the sync an offset slew centres the same: the mount keeps its pointing error
and is sent as far beside the target as that error is.
"""

import time
from dataclasses import replace

from kochab.core.attitude import apart_deg, wrapped
from kochab.core.errors import RefusedError
from kochab.core.mount import Ability, Pointing
from kochab.core.progress import Progress, Task
from kochab.core.solution import NoSolution, Solution, SolveNow
from kochab.core.values import frozen
from kochab.gear.mounts.coordinates import to_mount_epoch
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Preview, SyncEvidence
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr, tr_noop
from kochab.workflows.goto_target import Wait, apart, settled, with_retries

MOVED_ARCSEC = 60.0  # since the offer: less may be drift and rounding
TAKES = 3
UNMOVED = tr_noop("Sync on this frame only if the telescope has not moved since it was taken.")


@frozen
class SyncOffer:
    """What a sync would do, for a person to say yes to; nothing has changed yet.

    ``mount`` is the position the mount reported, in its own epoch; ``sky_deg`` the solved one,
    ICRS. ``no_sync`` is why the mount cannot be synced at all, empty when it can.
    """

    preview: Preview
    evidence: SyncEvidence
    solution: Solution
    mount: Pointing
    sky_deg: tuple[float, float]
    no_sync: str = ""

    @property
    def in_words(self) -> str:
        """The offset in one sentence: where the telescope really points."""
        p = self.preview
        return tr(
            "Mount is off by {angle}: it points {angle2} {east} and {angle3} {north} of where it reports.",
            angle=angle_text(p.offset_deg),
            angle2=angle_text(abs(p.east_deg)),
            east=tr("east") if p.east_deg >= 0 else tr("west"),
            angle3=angle_text(abs(p.north_deg)),
            north=tr("north") if p.north_deg >= 0 else tr("south"),
        )


@frozen
class SyncDone:
    """``synced``, or why not; ``slewed`` when an offset slew did it instead."""

    synced: bool
    slewed: bool
    sentence: str


def offer_sync(mount: Guard, solve_now: SolveNow) -> Task[SyncOffer | NoSolution]:
    """Take two frames that agree and say what a sync to them would do."""
    found = yield from agreeing_solves(mount, solve_now)
    return found if isinstance(found, NoSolution) else offer_of(mount, *found)


def offer_of(mount: Guard, *solutions: Solution) -> SyncOffer:
    """The offer from solves that were made just now; the last one counts.

    A single one is for those whose camera is another program's: a person vouches for it.
    """
    by_hand = len(solutions) == 1
    evidence = SyncEvidence.of(*solutions)
    sky = solutions[-1].ra_dec_deg
    here = with_retries(mount.position)
    there = mount.to_mount(*sky)
    preview = with_retries(lambda: mount.preview_sync(*there, evidence, by_hand))
    if by_hand:
        preview = replace(preview, warnings=(tr(UNMOVED), *preview.warnings))
    return SyncOffer(preview, evidence, solutions[-1], here, sky, mount.lacks.get(Ability.SYNC, ""))


def agreeing_solves(
    mount: Guard, solve_now: SolveNow, first: Solution | None = None
) -> Task[tuple[Solution, Solution] | NoSolution]:
    """Two solves in a row within the guard's limit; the last failure when there are none.

    ``first`` is one that was made just now.
    """
    limit = mount.limits.solves_agree_arcsec
    before = first
    for _ in range(TAKES):
        yield Progress("solving", None, tr("a second time") if before else "")
        solved = yield from solve_now()
        if isinstance(solved, NoSolution):
            return solved
        if before is not None and solves_apart_arcsec(before, solved) <= limit:
            return before, solved
        before = solved
    raise RefusedError(
        "The solves do not agree within {limit:g}″: the telescope is moving. Wait and solve again.", limit=limit
    )


def accept_sync(
    mount: Guard, offer: SyncOffer, *, confirmed: bool = False, fall_back: bool = False, wait: Wait = time.sleep
) -> Task[SyncDone]:
    """Do what was offered and read it back.

    The offset slew moves the telescope to the position that the mount reports now.

    Raises RefusedError when the guard forbids it, it needs a confirmation, or the telescope has moved since the offer.

    Parameters
    ----------
    mount : Guard
        Behind its guard.
    offer : SyncOffer
        What to sync to.
    confirmed : bool
        Whether the person has confirmed what the preview asks.
    fall_back : bool
        Slew by the offset when it cannot be synced.
    wait : Wait
        Waits so many seconds.
    """
    yield Progress("sync", 0.0, offer.in_words)
    _require_unmoved(mount, offer)
    refusal = offer.no_sync
    if not refusal:
        # Asked of the guard anew: the preview may have waited long for its yes.
        there = mount.to_mount(*offer.sky_deg)
        preview = with_retries(lambda: mount.preview_sync(*there, offer.evidence))
        require_allowed(mount, preview, confirmed)
        try:
            mount.sync(*there, offer.evidence, confirmed=confirmed)
        except RefusedError as error:  # by the mount: the guard was asked before
            refusal = str(error)
        else:
            return _done(offer)
    if not fall_back:
        return SyncDone(False, False, f"{refusal} {offer.in_words}")
    yield from _offset_slew(mount, offer, wait)
    return SyncDone(
        False,
        True,
        tr(
            "{refusal} The telescope slewed by the offset instead. The mount's coordinates are still off by {angle}.",
            refusal=refusal,
            angle=angle_text(offer.preview.offset_deg),
        ),
    )


def sync_by_hand(mount: Guard, offer: SyncOffer) -> Task[SyncDone]:
    """Do what a single solve offered: a person vouches that the telescope did not move before the offer.

    Raises RefusedError when it has moved since, or the guard forbids it.
    """
    yield Progress("sync", None, offer.in_words)
    _require_unmoved(mount, offer)
    mount.sync(*mount.to_mount(*offer.sky_deg), by_hand=True, confirmed=True)
    return _done(offer)


def _done(offer: SyncOffer) -> SyncDone:
    return SyncDone(
        True, False, tr("Synced by {angle}. Undo takes it back.", angle=angle_text(offer.preview.offset_deg))
    )


def _require_unmoved(mount: Guard, offer: SyncOffer) -> None:
    """Raise RefusedError when the mount moved while the offer waited for its yes: the solved place is then another."""
    moved = apart(with_retries(mount.position), offer.mount)
    if moved * 3600.0 > MOVED_ARCSEC:
        raise RefusedError("The mount has moved by {angle} since the frame. Take a new one.", angle=angle_text(moved))


def require_allowed(mount: Guard, preview: Preview, confirmed: bool) -> None:
    """Raise the guard's objection to a sync, before it is sent. Raises RefusedError with the guard's sentence."""
    against = [*preview.refusals, *(() if confirmed else preview.confirmations)]
    if against:
        mount.log.add(preview.action, "refused", against[0])
        raise RefusedError(against[0])


def _offset_slew(mount: Guard, offer: SyncOffer, wait: Wait) -> Task[None]:
    there = to_mount_epoch(*offer.sky_deg, mount.epoch, mount.clock())
    reported = offer.mount
    ra, dec = shifted(
        (reported.ra_deg, reported.dec_deg), wrapped(reported.ra_deg - there[0]), reported.dec_deg - there[1]
    )
    yield from mount.slew(ra, dec)  # as far beside the reported place as that is off
    yield from settled(mount, wait)


def shifted(place_deg: tuple[float, float], ra_deg: float, dec_deg: float) -> tuple[float, float]:
    """A place moved by so much along both axes; over the pole it comes down on the other side."""
    ra, dec = place_deg[0] + ra_deg, place_deg[1] + dec_deg
    if abs(dec) > 90.0:
        ra, dec = ra + 180.0, (180.0 if dec > 0 else -180.0) - dec
    return ra % 360.0, dec


def solves_apart_arcsec(one: Solution, other: Solution) -> float:
    """The angle between the centres of two solved frames."""
    return apart_deg(one.ra_dec_deg, other.ra_dec_deg) * 3600.0


def undo_sync(mount: Guard) -> Task[str]:
    """Restore the alignment that the mount had before the last sync; one sentence on what changed.

    Raises RefusedError when there is no sync to undo, or the guard or the mount refuses.
    """
    yield Progress("undo")
    before = with_retries(mount.position)
    mount.undo_sync()
    after = with_retries(mount.position)
    return tr("Sync undone. The mount's coordinates changed by {angle}.", angle=angle_text(apart(before, after)))
