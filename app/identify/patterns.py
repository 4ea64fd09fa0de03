"""The default method: quads of neighbouring stars, looked up by shape and verified.

Blind at any scale and for both parities. Where the scale is known and the stars are few, their
triangles are looked up first (:mod:`app.identify.known_search`): that needs fewer stars. Of quads,
the brightest detections are tried first; each stage takes more of them and allows larger errors. A
pointing is accepted only when chance cannot explain it (:mod:`app.identify.chance`), whatever found
it.
"""

from functools import partial

from app.core.detections import Detections
from app.core.errors import DamagedPatternsError
from app.core.hint import Hint
from app.core.progress import Progress, Task
from app.core.solution import Identification, NoSolution, Reason
from app.identify.answer import answered
from app.identify.finite import with_places
from app.identify.index import Volume
from app.identify.known_camera import COMPLETE, first_answer, known_camera
from app.identify.search import FINE, STAGES, Search, Stage
from app.identify.verify import FEWEST
from app.identify.volumes import drop_fine, fine, make_fine, shipped


class Patterns:
    """Lost in space by quads; see the module's text.

    ``volumes`` are the shipped ones and, for tests, all there are; by default the installation's.
    """

    def __init__(
        self, volumes: tuple[Volume, ...] | None = None, stages: tuple[Stage, ...] = STAGES
    ) -> None:
        self.volumes = volumes
        self.stages = stages

    def identify(
        self, detections: Detections, hint: Hint | None = None, year: float = 2016.0
    ) -> Task[Identification | NoSolution]:
        """Name the stars of one frame; see :class:`app.identify.Identifier`.

        The first frame that only the patterns for small fields can answer waits while those are
        made, and says so. So does one that finds them damaged.
        """
        places = partial(self._identify, hint=hint, year=year)
        try:
            return (yield from with_places(detections, places))
        except DamagedPatternsError as error:
            if self.volumes is not None or not drop_fine(error.folder):
                raise
        return (yield from with_places(detections, places))

    def _identify(
        self, detections: Detections, hint: Hint | None, year: float
    ) -> Task[Identification | NoSolution]:
        search = Search(detections, hint)
        known = known_camera(search, self.volumes or shipped(), year)
        found = yield from first_answer(search, known, detections)
        if found is not None:
            return found
        if len(search.xy) < FEWEST:
            return NoSolution(
                Reason.TOO_FEW_STARS,
                "Expose longer or point at a richer part of the sky.",
                f"{len(search.xy)} stars",
                len(detections),
            )
        if known and len(search.xy) <= COMPLETE:
            return self._none(search, detections)
        volumes = self.volumes
        if volumes is None:
            ready = fine()
            volumes = (*shipped(), ready) if ready else shipped()
        found = yield from self._search(search, volumes, self.stages, detections)
        if found is None and self.volumes is None and len(volumes) == FINE:
            late = tuple(s for s in self.stages if s.volume == FINE)
            if search.wants_small_fields(late):
                made = yield from make_fine()
                found = yield from self._search(search, (*volumes, made), late, detections)
        return found or self._none(search, detections)

    def _none(self, search: Search, detections: Detections) -> NoSolution:
        return NoSolution(
            Reason.NO_PATTERN_AGREED,
            "Check that the frame shows stars in focus.",
            f"{search.before + search.tried} pointings from {search.asked} star patterns",
            len(detections),
            measured={"pointings": search.before + search.tried, "log10_false_alarm": search.least},
        )

    def _search(
        self,
        search: Search,
        volumes: tuple[Volume, ...],
        stages: tuple[Stage, ...],
        detections: Detections,
    ) -> Task[Identification | None]:
        plan = search.plan(stages, volumes)
        for k, stage in enumerate(plan):
            yield Progress("identify", k / len(plan), f"{stage.stars} brightest stars")
            volume = volumes[stage.volume]
            for verdict in search.round(volume, stage):
                return answered(
                    verdict, detections, volume.rows, volume.stars, search.alarm(verdict),
                    search.tried,
                )  # fmt: skip
        return None
