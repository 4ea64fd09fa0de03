"""A mount that is judged: what would be done is planned, held against the rules, and told."""

from dataclasses import replace

from app.core.errors import RefusedError
from app.core.mount import Ability, Direction, Pointing
from app.mounts.held import Held
from app.mounts.limits import SyncEvidence
from app.mounts.planning import here_deg, planned, with_move, with_ways
from app.mounts.preview import Preview, preview_of
from app.mounts.rules import MOTION_RULES, MOVE_RULES, SYNC_RULES, Plan
from app.mounts.watch import Watch

OVERRUN, OVERRUN_TOLD = 4.0, 1.25  # how much further a move may go whose rate is not told, or is


class Judged(Held):
    """Previews, and what they forbid."""

    armed = False  # allows one sync beyond the largest step

    def preview_goto(self, ra_deg: float, dec_deg: float) -> Preview:
        """What a goto to the mount's own coordinates would do; nothing moves."""
        return self._goto_judged(ra_deg, dec_deg)[1]

    def preview_sync(
        self,
        ra_deg: float,
        dec_deg: float,
        evidence: SyncEvidence | None = None,
        by_hand: bool = False,
    ) -> Preview:
        """What a sync would do; nothing changes."""
        here = self.position()
        plan = self._plan("sync", here, (ra_deg, dec_deg))
        plan = replace(plan, evidence=evidence, by_hand=by_hand, armed=self.armed)
        return preview_of(plan, here_deg(here), (ra_deg, dec_deg), SYNC_RULES)

    def _goto_judged(self, ra_deg: float, dec_deg: float) -> tuple[Plan, Preview]:
        here = self.position()
        plan = with_ways(self._plan("goto", here, (ra_deg, dec_deg)))
        return plan, preview_of(plan, here_deg(here), (ra_deg, dec_deg), MOTION_RULES)

    def _plan(self, action: str, here: Pointing, to_deg: tuple[float, float]) -> Plan:
        return planned(action, here, to_deg, self.state(), self.limits, self.clock(), self.site)

    def _move_watch(
        self, action: str, direction: Direction, rate_deg_s: float, seconds: float
    ) -> Watch:
        """Judge where a move or pulse ends at the latest; what is then watched."""
        here, angle = self.position(), rate_deg_s * seconds
        plan = with_move(self._plan(action, here, here_deg(here)), direction, angle)
        self._require(preview_of(plan, plan.start_deg, plan.target_deg, MOVE_RULES), confirmed=True)
        overrun = OVERRUN_TOLD if hasattr(self.mount, "rates_deg_s") else OVERRUN
        (room,) = with_move(plan, direction, overrun * angle).paths
        return Watch(plan, room)

    def _able(self, ability: Ability) -> None:
        reason = self.lacks.get(ability)
        if reason is not None:
            raise RefusedError(reason)

    def _require(self, preview: Preview, confirmed: bool) -> None:
        if preview.refusals:
            self._refuse(preview.action, preview.refusals[0])
        if preview.confirmations and not confirmed:
            self._refuse(preview.action, preview.confirmations[0])
