"""What happened at one moment of the night, in order: the field jumped, the mount flipped, something crossed."""

from collections.abc import Iterator, Sequence
from datetime import datetime

from kochab.core.values import frozen
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr
from kochab.workflows.night.crossings import Crossing, CrossingKind
from kochab.workflows.night.tracking import JumpKind, Tracking


@frozen
class Event:
    """``kind`` for programs, ``text`` a sentence for people."""

    time_utc: datetime
    kind: str
    text: str


def events_of(tracking: Sequence[Tracking], crossings: Sequence[tuple[datetime, Crossing]] = ()) -> tuple[Event, ...]:
    """All events in order of time; dithers are none."""
    found = [*_of_jumps(tracking), *(Event(time, str(one.kind), words_of(one)) for time, one in crossings)]
    return tuple(sorted(found, key=lambda event: event.time_utc))


def words_of(one: Crossing) -> str:
    """A sentence on what crossed."""
    long = angle_text(one.length_deg)
    if one.kind is CrossingKind.SATELLITE:
        return tr(
            "{name} crossed, {off} from its predicted path.", name=one.name, off=angle_text(one.off_arcsec / 3600)
        )
    if one.kind is CrossingKind.AIRCRAFT:
        return tr("An aircraft crossed: strobes, or lights side by side.")
    if one.kind is CrossingKind.METEOR:
        return tr("Meteor candidate: a streak of {long} that brightens and fades in the frame.", long=long)
    return tr("A satellite or aircraft crossed ({long}) that is in none of the elements.", long=long)


def _of_jumps(tracking: Sequence[Tracking]) -> Iterator[Event]:
    for one in tracking:
        for jump in one.jumps:
            if jump.kind is not JumpKind.DITHER:
                yield Event(jump.time_utc, str(jump.kind), jump.words)
