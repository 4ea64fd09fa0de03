"""Safe sync: two agreeing solves, a look at the offset, the guard, the sync, and reading it back.

When the mount does not take a sync the same correction can be had by an offset slew: the mount
keeps its wrong idea of the sky, and is sent as far beside its target as that idea is wrong.
"""

import time
from dataclasses import dataclass

from app.core.attitude import apart_deg, separation_deg, unit_vectors
from app.core.errors import RefusedError
from app.core.mount import Ability, Pointing
from app.core.progress import Progress, Task
from app.core.solution import NoSolution, Solution
from app.mounts.epoch import to_mount_epoch
from app.mounts.guard import Guard
from app.mounts.limits import SyncEvidence
from app.mounts.preview import Preview
from app.mounts.sky_frame import wrapped
from app.workflows.fresh_frame import SolveNow
from app.workflows.goto_target import Wait, answered, settled

MOVED_ARCSEC = 60.0  # since the offer: more is another place, less may be drift and rounding
TAKES = 3


@dataclass(frozen=True, slots=True)
class SyncOffer:
    """What a sync would do, for a person to say yes to; nothing has changed yet.

    ``mount`` is where the mount said it pointed, in its own epoch; ``sky_deg`` where the sky says
    it points, ICRS. ``no_sync`` is why the mount cannot be synced at all, empty when it can.
    """

    preview: Preview
    evidence: SyncEvidence
    solution: Solution
    mount: Pointing
    sky_deg: tuple[float, float]
    no_sync: str = ""

    @property
    def in_words(self) -> str:
        """The offset in one sentence."""
        p = self.preview
        return (
            f"The sky is {_angle(p.offset_deg)} from where the mount says it points: "
            f"{_angle(abs(p.east_deg))} {'east' if p.east_deg >= 0 else 'west'}, "
            f"{_angle(abs(p.north_deg))} {'north' if p.north_deg >= 0 else 'south'}."
        )


@dataclass(frozen=True, slots=True)
class SyncDone:
    """``synced``, or why not; ``slewed`` when an offset slew did it instead."""

    synced: bool
    slewed: bool
    sentence: str


def offer_sync(mount: Guard, solve_now: SolveNow) -> Task[SyncOffer | NoSolution]:
    """Take two frames that agree and say what a sync to them would do."""
    found = yield from agreeing_solves(mount, solve_now)
    if isinstance(found, NoSolution):
        return found
    return offer_of(mount, *found)


def offer_of(mount: Guard, *solutions: Solution) -> SyncOffer:
    """The offer from solves that were made just now; the last one counts."""
    evidence = SyncEvidence.of(*solutions)
    sky = solutions[-1].ra_dec_deg
    here = answered(mount.position)
    there = mount.to_mount(*sky)
    preview = answered(lambda: mount.preview_sync(*there, evidence))
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
        yield Progress("solving", None, "a second time" if before else "")
        solved = yield from solve_now()
        if isinstance(solved, NoSolution):
            return solved
        if before is not None and _apart_arcsec(before, solved) <= limit:
            return before, solved
        before = solved
    raise RefusedError(
        f"The solves do not agree within {limit:g} arcsec: the telescope is moving, wait and "
        "solve again."
    )


def accept_sync(
    mount: Guard,
    offer: SyncOffer,
    *,
    confirmed: bool = False,
    fall_back: bool = False,
    wait: Wait = time.sleep,
) -> Task[SyncDone]:
    """Do what was offered and read it back; with ``fall_back`` slew when it cannot be synced.

    The offset slew moves the telescope to where the mount says that it points now.

    Raises
    ------
    RefusedError
        The guard forbids it, it needs a yes, or the telescope has moved since the offer.

    """
    yield Progress("sync", 0.0, offer.in_words)
    _same_place(mount, offer)
    refusal = offer.no_sync
    if not refusal:
        there = mount.to_mount(*offer.sky_deg)
        preview = answered(lambda: mount.preview_sync(*there, offer.evidence))
        hold_guard(mount, preview, confirmed)
        try:
            mount.sync(*there, offer.evidence, confirmed=confirmed)
        except RefusedError as error:  # by the mount: the guard was asked before
            refusal = str(error)
        else:
            return SyncDone(True, False, f"Synced: {offer.in_words} That is taken back by an undo.")
    if not fall_back:
        return SyncDone(False, False, f"{refusal} {offer.in_words}")
    yield from _offset_slew(mount, offer, wait)
    return SyncDone(
        False,
        True,
        f"{refusal} Instead the telescope was slewed by the offset, to where the mount said that "
        "it pointed; what the mount says is wrong by as much as before.",
    )


def hold_guard(mount: Guard, preview: Preview, confirmed: bool) -> None:
    """Raise what the guard has against a sync, before the mount is asked.

    Raises
    ------
    RefusedError
        One sentence of the guard.

    """
    against = [*preview.refusals, *(() if confirmed else preview.confirmations)]
    if against:
        mount.log.add(preview.action, "refused", against[0])
        raise RefusedError(against[0])


def _offset_slew(mount: Guard, offer: SyncOffer, wait: Wait) -> Task[None]:
    there = to_mount_epoch(*offer.sky_deg, mount.epoch, mount.clock())
    said = offer.mount
    ra, dec = shifted(
        (said.ra_deg, said.dec_deg), wrapped(said.ra_deg - there[0]), said.dec_deg - there[1]
    )
    yield from mount.slew(ra, dec)
    yield from settled(mount, wait)


def _same_place(mount: Guard, offer: SyncOffer) -> None:
    here = answered(mount.position)
    moved = 3600.0 * apart_deg(
        (here.ra_deg, here.dec_deg), (offer.mount.ra_deg, offer.mount.dec_deg)
    )
    if moved > MOVED_ARCSEC:
        raise RefusedError(
            f"The mount has moved by {moved / 60.0:.1f} arcmin since the frames: take new ones."
        )


def shifted(place_deg: tuple[float, float], ra_deg: float, dec_deg: float) -> tuple[float, float]:
    """A place moved by so much along both axes; over the pole it comes down on the other side."""
    ra, dec = place_deg[0] + ra_deg, place_deg[1] + dec_deg
    if abs(dec) > 90.0:
        ra, dec = ra + 180.0, (180.0 if dec > 0 else -180.0) - dec
    return ra % 360.0, dec


def _apart_arcsec(one: Solution, other: Solution) -> float:
    a, b = unit_vectors(*one.ra_dec_deg), unit_vectors(*other.ra_dec_deg)
    return separation_deg(a, b) * 3600.0


def _angle(degrees: float) -> str:
    if degrees < 1.0 / 60.0:
        return f"{degrees * 3600.0:.0f} arcsec"
    return f"{degrees * 60.0:.1f} arcmin" if degrees < 1.0 else f"{degrees:.2f} deg"
