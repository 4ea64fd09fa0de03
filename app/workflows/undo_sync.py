"""A person takes back the last sync."""

from app.core.attitude import apart_deg
from app.core.progress import Progress, Task
from app.mounts.guard import Guard
from app.workflows.goto_target import answered


def undo_sync(mount: Guard) -> Task[str]:
    """Give the mount back the idea of the sky that it had before; says what changed.

    Raises
    ------
    app.core.errors.RefusedError
        There is nothing to take back, or the guard or the mount refuses.

    """
    yield Progress("undo")
    before = answered(mount.position)
    mount.undo_sync()
    after = answered(mount.position)
    away = apart_deg((before.ra_deg, before.dec_deg), (after.ra_deg, after.dec_deg))
    return f"The sync was taken back: what the mount says is shifted by {away * 60.0:.1f} arcmin."
