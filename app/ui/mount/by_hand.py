"""A sync on the open frame alone, for those whose camera is another program's: on their word."""

from app.core.progress import Progress, Task
from app.core.solution import Solution
from app.mounts.guard import Guard
from app.mounts.limits import SyncEvidence
from app.workflows.goto_target import answered
from app.workflows.sync_mount import SyncDone, SyncOffer

WARNING = (
    "This is one frame, opened from a file: it counts only if the telescope has not moved since "
    "it was taken."
)


def offer_by_hand(mount: Guard, solution: Solution) -> Task[SyncOffer]:
    """What a sync to the open frame's place would do."""
    from dataclasses import replace

    from app.core.mount import Ability

    yield Progress("sync")
    sky = solution.ra_dec_deg
    here = answered(mount.position)
    there = mount.to_mount(*sky)
    preview = answered(lambda: mount.preview_sync(*there, by_hand=True))
    preview = replace(preview, warnings=(WARNING, *preview.warnings))
    lacking = mount.lacks.get(Ability.SYNC, "")
    return SyncOffer(preview, SyncEvidence.of(solution), solution, here, sky, lacking)


def accept_by_hand(mount: Guard, offer: SyncOffer) -> Task[SyncDone]:
    """Do it, and read it back."""
    yield Progress("sync", None, offer.in_words)
    mount.sync_icrs(*offer.sky_deg, by_hand=True, confirmed=True)
    return SyncDone(True, False, f"Synced: {offer.in_words} That is taken back by an undo.")
