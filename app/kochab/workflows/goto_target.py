"""Go to a target, and wait until the mount is at rest there."""

import re
import time
from collections.abc import Callable
from datetime import datetime
from typing import TypeVar

from kochab.core.attitude import apart_deg
from kochab.core.errors import NoAnswerError, RefusedError, StrayedError, UsageError
from kochab.core.frame import Site
from kochab.core.mount import Pointing
from kochab.core.progress import Progress, Task, run
from kochab.core.values import frozen
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_policy import due_side
from kochab.parsing.places import parse_place
from kochab.text.translation import tr, tr_noop

T = TypeVar("T")
Wait = Callable[[float], None]

POLL_S = 0.5
STILL_ARCSEC = 20.0  # between two readings; a mount that rounds to 15 may jump by that much
SETTLE_S = 3.0
PATIENCE_S = 60.0
MISSES = 3  # replies that may be lost in a row
RUNAWAY_DEG, RUNAWAY_READINGS = 0.25, 6  # still moving so far between readings, though not slewing


@frozen
class Target:
    """A place, ICRS degrees, and its name."""

    name: str
    ra_deg: float
    dec_deg: float


def named_target(name: str, time_utc: datetime, site: Site | None = None) -> Target:
    """A star, an object or a body of the Solar System by its name, where it is at ``time_utc`` seen from ``site``.

    See :mod:`kochab.sky.finder`. A satellite is none: it is elsewhere before a slew ends. Raises UsageError when
    nothing is called so, and when it is a guess or several things are: nothing moves towards those.
    """
    from kochab.sky.elements import kept_elements
    from kochab.sky.finder import NotFound, find
    from kochab.sky.kinds import kind_in_words
    from kochab.sky.small_bodies import SmallBodies

    name = name.strip()
    kept = [table for table in kept_elements() if isinstance(table, SmallBodies)]
    found = run(find(name, time_utc, site, kept))
    if isinstance(found, NotFound):
        raise UsageError("{sentence}", sentence=found.sentence)
    if found.alternatives:
        choices = ", ".join([f"{found.name} ({kind_in_words(found.kind)})", *found.alternatives])
        raise UsageError("{name} can be {choices}: enter one of them.", name=name, choices=choices)
    if not found.sure:
        raise UsageError("{sentence}", sentence=NotFound(name, (found.name,)).sentence)
    return Target(name, found.ra_deg, found.dec_deg)


def target_at(ra_deg: float, dec_deg: float) -> Target:
    """A place by ICRS degrees; UsageError when out of range."""
    if not (-360.0 <= ra_deg <= 360.0 and -90.0 <= dec_deg <= 90.0):
        raise UsageError("RA {ra_deg:g}, Dec {dec_deg:g} is not a valid position.", ra_deg=ra_deg, dec_deg=dec_deg)
    return Target(f"RA {ra_deg % 360.0:.4f} Dec {dec_deg:+.4f}", ra_deg % 360.0, dec_deg)


NOTHING = tr_noop("Enter a target: a name such as M 42, Vega or HIP 32349, or “5h35m17s -5d23m”.")


def parse_target(text: str, time_utc: datetime, site: Site | None = None) -> Target:
    """A target from ``M 42``, ``Jupiter``, ``83.82 -5.39``, ``5h35m17s, -5d23m28s``.

    A name is looked up in the catalogue, which takes a moment the first time: not for the
    window's thread. UsageError says what is wrong.
    """
    clean = " ".join(text.split())
    if not clean:
        raise UsageError(NOTHING)
    place = parse_place(clean)
    if place is not None:
        return target_at(*place)
    # Digits alone are no name, but those before letters are: 47 Tuc.
    if not re.search(r"[^\W\d_]{2}", clean) and not re.match(r"[^\W\d_]", clean):
        raise UsageError("“{text}” is not a known name or position. {nothing}", text=clean, nothing=tr(NOTHING))
    return named_target(clean, time_utc, site)


def resolved(text: str, time_utc: datetime, site: Site | None) -> Task[Target]:
    """The same as a task, for who may not wait for the catalogue."""
    yield Progress("names")
    return parse_target(text, time_utc, site)


def names_to_offer() -> Task[list[str]]:
    """What the field completes: Messier objects and the stars that bear a name of their own."""
    yield Progress("names")
    from kochab.sky import open_catalogue

    stars = sorted({name for name, _, _ in open_catalogue().names.table.values() if name})
    return [f"M {n}" for n in range(1, 111)] + stars


@frozen
class FlipQuestion:
    """Nothing but a meridian flip stands against a goto: a person decides."""

    text: str
    sentence: str


def goto_typed(mount: Guard, text: str, flip: bool = False) -> Task[str | FlipQuestion]:
    """Slew to a name or coordinates as a person typed them, by a ``flip`` only when asked for; what the mount says."""
    yield Progress("goto", None, text)
    target = parse_target(text, mount.clock(), mount.site)
    there = mount.to_mount(target.ra_deg, target.dec_deg)
    if not flip and mount.policy.asks_flip(mount.position(), state := mount.state(), there):
        return FlipQuestion(
            text,
            tr(
                "{name} is across the meridian: the mount is {pier} of its pier and must flip. Watch "
                "the cables and the tube. For a fork or wedge, set Meridian.",
                name=target.name,
                pier=tr(state.pier_side or ""),
            ),
        )
    yield from goto_target(mount, target, flip=flip)
    return tr("The mount reports that it reached {name}.", name=target.name)


def flip_mount(mount: Guard) -> Task[str]:
    """Flip a German mount where it points, and see it on the other side of its pier.

    Raises `RefusedError` when no flip is due, or the mount does not do it.
    """
    yield Progress("flip")
    state, here = mount.state(), mount.position()
    if mount.limits.crosses_meridian:
        raise RefusedError("A fork or wedge needs no flip.")
    if (side := state.pier_side) is None:
        raise RefusedError("The mount does not report its pier side: flip it with its hand control.")
    if due_side(mount.policy.goto(here, state, (here.ra_deg, here.dec_deg))[0], flip=True) in (None, side):
        raise RefusedError("No flip is due: the mount is {side} of its pier, as it should be here.", side=tr(side))
    yield from mount.slew(here.ra_deg, here.dec_deg, flip=True)
    return tr("Flipped: the mount is {opposite} of its pier.", opposite=tr(side.opposite))


def goto_target(mount: Guard, target: Target, wait: Wait = time.sleep, flip: bool = False) -> Task[Pointing]:
    """Slew within the guard and return when the mount is at rest; cancelling stops it.

    Raises RefusedError when the guard or the mount refuses; one sentence.

    Parameters
    ----------
    mount : Guard
        Behind its guard.
    target : Target
        Where to.
    wait : Wait
        Waits so many seconds.
    flip : bool
        Whether a person has asked for the other side of the pier.
    """
    yield Progress("goto", 0.0, target.name)
    yield from mount.slew(*aimed(mount, target, flip), flip)
    return (yield from settled(mount, wait))


def aimed(mount: Guard, target: Target, flip: bool = False) -> tuple[float, float]:
    """Where to send the mount: the target in its own coordinates, by the pointing model that is in use.

    Raises RefusedError when the target itself is not allowed, wherever the model would send the mount.
    """
    place, aim = mount.to_mount(target.ra_deg, target.dec_deg), mount.supervisor.aim
    if aim is None:
        return place
    # slew() checks the place it is given, which is the aim: the target is checked here.
    for refusal in mount.policy.goto(mount.position(), mount.state(), place, flip)[1].refusals:
        raise RefusedError(refusal)
    return aim(place, mount.clock())


def settled(mount: Guard, wait: Wait = time.sleep, settle_s: float = SETTLE_S) -> Task[Pointing]:
    """Wait until two readings agree and nothing slews, then ``settle_s`` for vibrations to die.

    A mount that is stopped in the meantime counts as settled.

    Raises `NoAnswerError` when it does not come to rest within a minute, or does not reply, and `StrayedError` when it
    kept moving while it reported no slew, and was stopped.
    """
    before, running = None, 0
    for _ in range(round(PATIENCE_S / POLL_S)):
        yield Progress("settling")
        wait(POLL_S)
        slewing = with_retries(lambda: mount.state().slewing)
        here = with_retries(mount.position)
        moved_deg = None if before is None or slewing else apart(before, here)
        if moved_deg is not None and moved_deg * 3600.0 <= STILL_ARCSEC:
            yield Progress("settling")
            wait(settle_s)
            return here
        running = running + 1 if moved_deg is not None and moved_deg > RUNAWAY_DEG else 0
        if running == RUNAWAY_READINGS:
            mount.halt()
            raise StrayedError("The mount kept moving while it reported no slew. Kochab stopped it.")
        before = here
    mount.halt()
    raise NoAnswerError("The mount did not stop moving within {patience:g} s. Kochab stopped it.", patience=PATIENCE_S)


def with_retries(query: Callable[[], T]) -> T:
    """The reply to a query that changes nothing, sent again when a reply is lost."""
    for _ in range(MISSES - 1):
        try:
            return query()
        except NoAnswerError:
            continue
    return query()


def apart(one: Pointing, other: Pointing) -> float:
    """The angle between two reported positions, degrees."""
    return apart_deg((one.ra_deg, one.dec_deg), (other.ra_deg, other.dec_deg))
