"""Two frames dropped on the window that show a polar axis: the Polar view opens with the answer."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject

from kochab.core.solution import Solution
from kochab.polar.pair import turned_about_a_pole
from kochab.window.frame.batch import Batch, images_in


class DroppedPair(QObject):
    """Waits until both are solved; ``measure`` is given them when they are of a turn about a pole."""

    def __init__(self, batch: Batch, measure: Callable[[list[Path]], None]) -> None:
        super().__init__(batch)
        self._batch, self._measure = batch, measure
        self._pair: list[Path] = []
        batch.moved.connect(self._look)

    def take(self, paths: list[Path]) -> None:
        """Files were dropped."""
        try:
            found = [] if any(path.is_dir() for path in paths) else images_in(paths)
        except OSError:
            found = []  # whoever opens them says so
        self._pair = found if len(found) == 2 else []
        self._look()

    def _look(self) -> None:
        """Not before the strip is at rest: its files are solved one after the other."""
        if not self._pair or self._batch.at is not None:
            return
        states = [self._batch.files.get(path) for path in self._pair]
        results = [state.result for state in states if state is not None]
        if len(results) == 2 and None in results:
            return  # it only begins
        pair, self._pair = self._pair, []
        one, other = (*results, None, None)[:2]
        if (
            isinstance(one, Solution)
            and isinstance(other, Solution)
            and turned_about_a_pole(one.centre_attitude, other.centre_attitude)
        ):
            self._measure(pair)
