"""What happened at one moment of the night, in order: the field jumped, the mount flipped."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime

from kochab.workflows.night.tracking import JumpKind, Tracking


@dataclass(frozen=True, slots=True)
class Event:
    """``kind`` for programs, ``text`` a sentence for people."""

    time_utc: datetime
    kind: str
    text: str


def events_of(tracking: Sequence[Tracking]) -> tuple[Event, ...]:
    """All events in order of time; dithers are none."""
    return tuple(sorted(_of_jumps(tracking), key=lambda event: event.time_utc))


def _of_jumps(tracking: Sequence[Tracking]) -> Iterator[Event]:
    for one in tracking:
        for jump in one.jumps:
            if jump.kind is not JumpKind.DITHER:
                yield Event(jump.time_utc, str(jump.kind), jump.words)
