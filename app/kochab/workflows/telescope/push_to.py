"""Push-to: which way and how far a person pushes the telescope to its target, from live solves.

With a site the way is in azimuth and altitude, as a Dobsonian turns; without one it is along right ascension and
declination, as an equatorial mount does. The solves tell where it points, so no encoder and no alignment is needed;
encoders or a gyroscope on it tell it between two solves, too.
"""

import math
from dataclasses import replace
from math import atan2, cos, degrees, hypot, radians

from kochab.core.attitude import Degrees, apart_deg, unit_vectors, wrapped
from kochab.core.values import frozen
from kochab.sky.horizon import Horizon
from kochab.text.angle_text import age_text, angle_text
from kochab.text.translation import tr, tr_noop
from kochab.workflows.goto_target import Target
from kochab.workflows.telescope.offered import OfferedTelescope

THERE_DEG, WORTH_SAYING_DEG = 5.0 / 60.0, 0.5 / 60.0
OLD_S = 10.0
"""A telescope that is pushed has gone on since a frame older than this."""
BELOW = tr_noop("{name} is below the horizon.")


@frozen
class PushTo:
    """From where it points to the target, degrees.

    ``right_deg`` is to turn it clockwise seen from above, or west without a site; ``up_deg`` higher, or north.
    ``age_s`` is how old the pointing is. Both angles are of the axes: azimuth is not multiplied by cos(altitude).
    """

    target: Target
    distance_deg: float
    right_deg: float
    up_deg: float
    on_sky_deg: Degrees
    """The same two on the sky, for the arrow."""
    with_site: bool
    below: bool = False
    age_s: float = 0.0
    made_s: float = 0.0
    """When this was so, on :func:`time.monotonic`."""
    sigma_deg: float = 0.0
    """1 sigma of where it points, by encoders or a gyroscope; 0 of a solve."""
    felt_s: float = 0.0
    """Seconds from the last solved frame to this position by encoders or a gyroscope; 0 without them."""

    @property
    def there(self) -> bool:
        """Whether the target is in the eyepiece."""
        return self.distance_deg <= THERE_DEG and self.sigma_deg <= THERE_DEG and not self.old

    @property
    def old(self) -> bool:
        """Whether the telescope may have moved since."""
        return self.age_s > OLD_S

    @property
    def arrow_deg(self) -> float:
        """The arrow on a screen: 0 up, 90 to the right."""
        return degrees(atan2(*self.on_sky_deg))

    @property
    def words(self) -> str:
        """What to do, in one sentence."""
        if self.below:
            return tr(BELOW, name=self.target.name)
        if self.there:
            return tr("{name} is in the eyepiece.", name=self.target.name)
        right, left = (tr("right"), tr("left")) if self.with_site else (tr("west"), tr("east"))
        up, down = (tr("up"), tr("down")) if self.with_site else (tr("north"), tr("south"))
        way = []
        if abs(self.on_sky_deg[0]) > THERE_DEG / 2.0:
            way.append(f"{angle_text(abs(self.right_deg))} {right if self.right_deg > 0 else left}")
        if abs(self.on_sky_deg[1]) > THERE_DEG / 2.0:
            way.append(f"{angle_text(abs(self.up_deg))} {up if self.up_deg > 0 else down}")
        if not way:
            return tr("{name} is close. The next solved frame shows the rest of the way.", name=self.target.name)
        return tr("Push {way}.", way=", ".join(way))

    @property
    def distance_text(self) -> str:
        """The distance, with its 1 sigma when it comes from encoders or a gyroscope."""
        distance = angle_text(self.distance_deg)
        return f"{distance} ± {angle_text(self.sigma_deg)}" if self.sigma_deg >= WORTH_SAYING_DEG else distance

    @property
    def age_words(self) -> str:
        """How old the pointing is, where that matters; empty otherwise."""
        solved_s = self.age_s + self.felt_s
        if solved_s <= OLD_S:
            return ""
        age, sigma = age_text(solved_s), angle_text(self.sigma_deg)
        if self.old:
            return tr("Last solved {age} ago.", age=age)
        return tr(
            "Last solved {age} ago; position since then from encoders or gyroscope (± {sigma}).", age=age, sigma=sigma
        )


def phone_json(way: PushTo, now_s: float) -> dict[str, object]:
    """The same for the page on a phone, as old as it is when asked, ``now_s`` of :func:`time.monotonic`."""
    way = replace(way, age_s=way.age_s + max(0.0, now_s - way.made_s))
    right, up = way.on_sky_deg
    marks = ("←", "→", "↓", "↑") if way.with_site else ("E", "W", "S", "N")
    return {
        "words": way.words,
        "total": way.distance_text,
        "sigma": way.target.name,
        "azimuth": f"{marks[right > 0]} {angle_text(abs(way.right_deg))}",
        "altitude": f"{marks[2 + (up > 0)]} {angle_text(abs(way.up_deg))}",
        "solved": True,
        "age": way.age_words,
        "old": way.old,
        "distance_deg": way.distance_deg,
        "there": way.there,
    }


def push_to(telescope: OfferedTelescope, now_s: float) -> PushTo | None:
    """The way to the telescope's target at ``now_s`` of :func:`time.monotonic`; None without a target or a pointing."""
    target, seen = telescope.target, telescope.seen
    if target is None or seen is None:
        return None
    there = (target.ra_deg, target.dec_deg)
    distance, age_s = apart_deg(seen.icrs_deg, there), max(0.0, now_s - seen.at_s)
    below = False
    if telescope.site is None:
        right, up = wrapped(seen.icrs_deg[0] - there[0]), there[1] - seen.icrs_deg[1]
        sky = right * cos(radians(there[1])), up
    else:
        horizon = Horizon(telescope.site, telescope.now())
        (altitude, azimuth), (wanted, towards) = (horizon.altaz_deg(unit_vectors(*p)) for p in (seen.icrs_deg, there))
        right, up = wrapped(towards - azimuth), wanted - altitude
        sky, below = (right * cos(radians(wanted)), up), wanted < 0.0
    how = telescope.site is not None, below, age_s, now_s, seen.sigma_deg, seen.felt_s
    return PushTo(target, distance, right, up, _scaled(sky, distance), *how)


def _scaled(sky_deg: Degrees, distance_deg: float) -> Degrees:
    """The same direction, as long as the way on the sky is: over a wide turn the axes' angles add up to more."""
    length = hypot(*sky_deg)
    return (0.0, 0.0) if math.isclose(length, 0.0) else tuple(x / length * distance_deg for x in sky_deg)  # type: ignore[return-value]
