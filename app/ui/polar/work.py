"""The alignment that a person wished for, as one task."""

from app.core.progress import Task
from app.mounts.guard import Guard
from app.polar.history import History
from app.ui.polar.tools import Tools, told
from app.ui.polar.wish import AlignWish, Source
from app.ui.polar.work_camera import align_camera
from app.ui.polar.work_files import measure_files


def working(wish: AlignWish, tools: Tools, guard: Guard | None = None) -> Task[History]:
    """What ``wish`` says, from the first frame to the last; with a ``guard`` the mount turns.

    Raises
    ------
    KochabError
        One sentence with what to do.

    """
    if wish.source is Source.FILES:
        return (yield from told(measure_files(wish, tools), tools.tell))
    return (yield from told(align_camera(wish, tools, guard), tools.tell))
