"""A mount that is synced: on evidence, read back, and taken back on request."""

from dataclasses import replace

from app.core.attitude import apart_deg
from app.core.errors import RefusedError
from app.core.mount import Ability
from app.mounts.judged import Judged
from app.mounts.limits import SyncEvidence
from app.mounts.planning import here_deg
from app.mounts.preview import preview_of
from app.mounts.rules import SYNC_RULES
from app.mounts.sky_frame import wrapped


class Synced(Judged):
    """Syncs of the mount's own coordinates or of ICRS."""

    _before_sync: tuple[float, float] | None = None

    def sync(
        self,
        ra_deg: float,
        dec_deg: float,
        evidence: SyncEvidence | None = None,
        *,
        by_hand: bool = False,
        confirmed: bool = False,
    ) -> None:
        """Sync on two agreeing solves, or ``by_hand`` on a person's word, and read it back.

        Raises
        ------
        RefusedError
            A rule forbids it, it needs a yes (``confirmed``), or the mount did not take it:
            then an offset slew does the same without a sync.

        """
        self._able(Ability.SYNC)
        preview = self.preview_sync(ra_deg, dec_deg, evidence, by_hand)
        self._require(preview, confirmed)
        self._sync(ra_deg, dec_deg)
        shift = (wrapped(preview.from_deg[0] - ra_deg), preview.from_deg[1] - dec_deg)
        self._before_sync = shift
        self.armed = False

    def sync_icrs(
        self,
        ra_deg: float,
        dec_deg: float,
        evidence: SyncEvidence | None = None,
        *,
        by_hand: bool = False,
        confirmed: bool = False,
    ) -> None:
        """:meth:`sync` on ICRS degrees."""
        ra, dec = self.to_mount(ra_deg, dec_deg)
        self.sync(ra, dec, evidence, by_hand=by_hand, confirmed=confirmed)

    @property
    def can_undo(self) -> bool:
        """Whether there is a sync to take back."""
        return self._before_sync is not None

    def undo_sync(self) -> None:
        """Take back the last sync, wherever the mount has gone since."""
        if self._before_sync is None:
            raise RefusedError("There is no sync to take back.")
        here = self.position()
        ra = (here.ra_deg + self._before_sync[0]) % 360.0
        dec = min(90.0, max(-90.0, here.dec_deg + self._before_sync[1]))
        plan = self._plan("sync", here, (ra, dec))
        self._require(
            preview_of(
                replace(plan, by_hand=True, armed=True),
                here_deg(here),
                (ra, dec),
                SYNC_RULES,
            ),
            confirmed=True,
        )
        self._sync(ra, dec)
        self._before_sync = None

    def _sync(self, ra_deg: float, dec_deg: float) -> None:
        self._motion.watch = None  # the end of a pulse may still be waited for: this is no jump
        self._send(
            "sync", 0.0, lambda: self.mount.sync(ra_deg, dec_deg), ra_deg=ra_deg, dec_deg=dec_deg
        )
        here = self.position()
        away = 3600.0 * apart_deg(here_deg(here), (ra_deg, dec_deg))
        if away > self.limits.read_back_arcsec:
            sentence = (
                f"The mount did not take the sync, it still points {away / 60.0:.1f} arcmin from "
                "there: use an offset slew instead."
            )
            self.log.add("sync", "failed", sentence)
            raise RefusedError(sentence)
        self.log.add("sync", "done", detail={"read_back_arcsec": away})
