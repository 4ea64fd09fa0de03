"""Lines of a chart and its axes; lines differ by colour, dashes and marker, so that any one suffices."""

from PySide6.QtGui import QColor

from kochab.core.values import frozen
from kochab.text.translation import number, tr
from kochab.window.themes import THEMES, Colours

ON_DARK = ("#56b4f9", "#f0b440", "#5fd39a", "#ff8a7a", "#c79bf2", "#9aa7b8", "#e7e36a", "#ff7ab0")
ON_LIGHT = ("#0a63b0", "#a86200", "#17703f", "#b3261e", "#6a3fb5", "#515b69", "#7a7400", "#b0266f")
# Red light leaves two shades to tell apart; dashes and markers tell the lines.
ON_RED = ("#ff0000", "#d00000", "#ff0000", "#d00000")
DASHES: tuple[tuple[float, ...], ...] = ((), (6, 3), (2, 2), (8, 3, 2, 3))
MARKERS = ("o", "s", "t1", "p", "d", "t")  # as the plotting library calls them
WIDTH_PX, MARKER_PX = 1.8, 7


@frozen
class ChartAxis:
    """``span`` is what is shown at first; without one it follows the lines."""

    title: str
    unit: str = ""
    span: tuple[float, float] | None = None
    log: bool = False

    def text(self, value: float) -> str:
        return f"{number(value, '.3g').replace('-', '−')} {tr(self.unit)}".rstrip()

    @property
    def label(self) -> str:
        """What stands beside the axis."""
        return f"{tr(self.title)}, {tr(self.unit)}" if self.unit else tr(self.title)


@frozen
class Series:
    """One line; ``style`` numbers its colour, dashes and marker. NaN breaks the line.

    ``sigma``, one standard deviation of each ``y``, is drawn as bars where there is one.
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    style: int = 0
    sigma: tuple[float, ...] = ()


@frozen
class LineStyle:
    """One line; ``dashes`` in widths of the line, none for a whole one."""

    colour: str
    dashes: tuple[float, ...]
    marker: str


def line_style(number: int, colours: Colours) -> LineStyle:
    """The look of line ``number`` in a theme."""
    if colours is THEMES["night"]:
        chosen: tuple[str, ...] = ON_RED
    else:
        chosen = ON_LIGHT if QColor(colours.surface).lightnessF() > 0.5 else ON_DARK
    return LineStyle(chosen[number % len(chosen)], DASHES[number % len(DASHES)], MARKERS[number % len(MARKERS)])
