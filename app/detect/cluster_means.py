"""The centre of a cluster that grows pixel by pixel, in floating and in fixed point.

The thesis "Attitude from stellar images", equations 2.1 and 2.2, section 3.2 and section 4.2.4.1:
fixed centres are 10.22 numbers that count from the middle of the frame, and no two are more than
512 px apart, the size of the largest frame there. The thesis does not say how it keeps a centre
that is needed after every pixel; here each pixel moves it by its share of the light so far, cut
off at the last bit.
"""

from app.core.fixed_point import FixedPointOverflowError, Format

PLACE = Format(10, 22)
LIGHT = Format(32, 0)  # the sum of the brightnesses


class FloatMean:
    """Sums of light; ``place`` is the centre so far, px."""

    __slots__ = ("light", "of_x", "of_y", "pixels", "place")

    def __init__(self, x: float, y: float, light: float) -> None:
        self.of_x, self.of_y, self.light, self.pixels = x * light, y * light, light, 1
        self.place = (x, y)

    def add(self, x: float, y: float, light: float) -> None:
        """Take one more pixel."""
        self.of_x += x * light
        self.of_y += y * light
        self.light += light
        self.pixels += 1
        self.place = self.of_x / self.light, self.of_y / self.light


class FixedMean:
    """Centres ``at_x`` and ``at_y`` as 10.22 integers; ``light`` is whole."""

    __slots__ = ("at_x", "at_y", "light", "pixels")

    def __init__(self, x: float, y: float, light: float) -> None:
        self.at_x, self.at_y = _number(x), _number(y)
        self.light, self.pixels = round(light), 1

    @property
    def place(self) -> tuple[float, float]:
        """The centre so far, px from the frame's middle."""
        return self.at_x * PLACE.step, self.at_y * PLACE.step

    def add(self, x: float, y: float, light: float) -> None:
        """Take one more pixel; FixedPointOverflowError when a sum has no room."""
        part = round(light)
        self.light = _checked(self.light + part, LIGHT)
        self.at_x = _moved(self.at_x, _number(x), part, self.light)
        self.at_y = _moved(self.at_y, _number(y), part, self.light)
        self.pixels += 1


def _number(value: float) -> int:
    """A place as a 10.22 integer."""
    return _checked(int(value * (1 << PLACE.fraction)), PLACE)


def _moved(centre: int, place: int, part: int, total: int) -> int:
    step = _checked(place - centre, PLACE) * part
    share = abs(step) // max(total, 1)
    return _checked(centre + (share if step > 0 else -share), PLACE)


def _checked(value: int, form: Format) -> int:
    if not form.low <= value <= form.high:
        raise FixedPointOverflowError(
            f"{value * form.step:g} does not fit a {form} fixed-point number."
        )
    return value
