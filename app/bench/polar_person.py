"""The person of the polar bench: points the telescope, and turns the bolts as told."""

from dataclasses import replace
from typing import Any

from app.bench.polar_rig import RigSky
from app.core.mount import Direction
from app.core.progress import run as run_task
from app.polar.measure import Settings
from app.polar.path import way
from app.polar.sighting import to_local
from app.polar.tutor import BoltTutor, Instruction
from app.workflows.polar_align import Alignment, AlignOptions, align
from app.workflows.polar_measure import Sweep, foreseen_arcsec
from app.workflows.polar_update import PolarControls, PolarUpdate

ALIGN = AlignOptions(30.0, sweep=Sweep(frames=7, most_frames=25, goal_arcsec=4.0, least_deg=60.0))
PLACING = Sweep(turn_deg=90.0, frames=15, most_frames=15)
PLACES = 40
MOST_MOVES = 15
MOST_PLACES = 2000


def align_options(second_sweep: bool) -> AlignOptions:
    """As the bench aligns, with or without a second sweep before it is called good."""
    return replace(ALIGN, second_sweep=second_sweep)


def follow(sky: RigSky, options: AlignOptions = ALIGN) -> Alignment:
    """Drive an alignment while hands do what is told; they give up after too many moves."""
    controls, told = PolarControls(), None

    def person(update: Any) -> None:
        nonlocal told
        new: Instruction | None = getattr(update, "instruction", None)
        if not isinstance(update, PolarUpdate) or new is None or new is told:
            return
        told = new
        if update.moves > MOST_MOVES:
            controls.enough()
        if new.knob is not None:
            sky.hand(new)
            controls.turned()

    task = align(sky, sky, sky.settings, options, controls, BoltTutor())
    return run_task(task, person)


def somewhere_wide(sky: RigSky) -> RigSky:
    """Point anew until a sweep of 60 deg stays above 15 deg one way."""
    for _ in range(MOST_PLACES):
        there = to_local(sky.look(), sky.settings.site, sky.settings.air)
        ways = (way(there.boresight, sky.settings, d, 60.0) for d in
                (Direction.WEST, Direction.EAST))  # fmt: skip
        if any(w.good for w in ways):
            return sky
        sky.point_elsewhere()
    raise RuntimeError("no part of the sky allows a sweep of 60 deg")


def somewhere_good(sky: RigSky, settings: Settings) -> None:
    """Of some places anywhere, the one the planner likes best; it tells before anything turns."""
    best, least = (sky.hidden.hour_deg, sky.hidden.dec_deg), float("inf")
    for _ in range(PLACES):
        first = to_local(sky.look(), settings.site, settings.air)
        foreseen = foreseen_arcsec(first, settings, PLACING)
        if foreseen < least:
            best, least = sky.stands_deg, foreseen
        sky.point_elsewhere()
    sky.point(*best)
