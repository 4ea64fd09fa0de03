"""The mount's clock and site beside the computer's: what contradicts forbids slews and syncs."""

from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime, timedelta

from kochab.core.attitude import apart_deg
from kochab.core.errors import NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Mount, Pointing, SiteReport
from kochab.gear.mounts.motion_policy import MotionPolicy
from kochab.parsing.angles import site_text
from kochab.sky.horizon import sidereal_deg
from kochab.text.translation import tr, tr_n, tr_noop

CLOCK_S, SITE_DEG = 120.0, 0.5  # in two minutes the sky turns by half a degree, too
SHIFTED_DEG = 0.5  # a new clock or site that shifts the position by more calls for a sync
ASKED = 2  # unanswered questions after which the mount counts as not reporting them
COMMANDS = {Ability.SET_CLOCK: "kochab mount set-clock", Ability.SET_SITE: "kochab mount set-site"}
JUMPED_S = 30.0  # of a clock that runs on: more than a late answer, less than a board without a battery loses
JUMPED = tr_noop("Mount was restarted, or its clock or site was set by someone: after a silence {what}.")
HOUR_S, ZONE_S, DAY_S = 3600.0, 1800.0, 86400.0  # nearly all time zones differ by multiples of half an hour


class ClockAndSite:
    """Tells the ``policy`` what a mount contradicts of the computer's clock and of the site.

    ``restarted`` hears of a mount that after a silence tells otherwise than before, whatever the computer has;
    ``on_trust`` of a person who says that the mount is right.
    """

    def __init__(
        self,
        policy: MotionPolicy,
        restarted: Callable[[str], None] = lambda sentence: None,
        on_trust: Callable[[], None] = lambda: None,
    ) -> None:
        self._policy, self._restarted, self._on_trust = policy, restarted, on_trust
        # How far ahead its clock was, and all that it reported.
        self._reported: tuple[float | None, SiteReport] | None = None
        self._missed: int | None = 0
        self.forget()

    def forget(self) -> None:
        """Compare again before the next slew: the site is another, or the mount was switched on again.

        A position that was lost is not found by that: only a sync or a person settles it.
        """
        self._left, self._trusted, self._policy.clock_conflict = ASKED, False, ""
        self.wrong: dict[Ability, str] = {}  # what would mend it -> what is wrong

    def reconnected(self) -> None:
        """The line was lost: compare again, with what it told before, too."""
        self.forget()
        self._missed = None

    def trust(self) -> None:
        """A person says that the mount is right."""
        self._on_trust()
        self._trusted, self._policy.clock_conflict, self._policy.slew_block_reason = True, "", ""

    def shifted(self, before: Pointing, after: Pointing) -> None:
        """Its position, with a new clock or site: a sync before it was of the old one."""
        self._reported = None
        shift_deg = apart_deg((before.ra_deg, before.dec_deg), (after.ra_deg, after.dec_deg))
        if shift_deg > SHIFTED_DEG and not self._trusted:
            self._policy.slew_block_reason = tr(
                "The mount's position shifted by {shift:.1f}° with its new clock or site. Sync on a "
                "solved frame before you slew, or say that the mount is right (--trust-mount).",
                shift=shift_deg,
            )

    def compare(self, mount: Mount) -> None:
        """Ask the mount, unless it agreed already: what contradicts may have been set on its hand control.

        After every silence, too: in it the mount may have been without power.
        """
        if self._silent(mount) or (not self._trusted and (self._left > 0 or self._policy.clock_conflict)):
            self.ask(mount)

    def _silent(self, mount: Mount) -> bool:
        return self._reported is not None and mount.missed != self._missed

    def ask(self, mount: Mount) -> str:
        """What contradicts now, in a sentence; empty when nothing does, or nothing is told."""
        silent = self._silent(mount)
        try:
            report = mount.site_report()
            if silent and self._otherwise(report):
                report = mount.site_report()  # a late answer may be of before, and midnight passes between two
        except NoAnswerError:
            with suppress(NoAnswerError):  # one that answers nothing at all is asked again
                mount.position()
                self._left -= 1
            return self._policy.clock_conflict
        if silent and (what := self._otherwise(report)):
            self._restarted(tr(JUMPED).format(what=what))
        self._reported, self._missed = (self._ahead_s(report), report), mount.missed
        self._left = 0  # it does report them: ask again only while they contradict
        conflicts = {Ability.SET_CLOCK: self._clock(report), Ability.SET_SITE: self._site(report)}
        self.wrong = {ability: words for ability, words in conflicts.items() if words and not self._trusted}
        self._policy.clock_conflict = self._sentence(mount) if self.wrong else ""
        return self._policy.clock_conflict

    def sidereal_deg(self, mount: Mount) -> float | None:
        """By the mount's own clock and site, which its right ascension rests on; None where it does not tell both."""
        if self._reported is None and self._left > 0:
            self.ask(mount)
        ahead_s, report = self._reported or (None, SiteReport())
        if ahead_s is None or report.site is None:
            return None
        return sidereal_deg(report.site, self._policy.clock() + timedelta(seconds=ahead_s))

    def _ahead_s(self, report: SiteReport) -> float | None:
        return None if report.time_utc is None else (report.time_utc - self._policy.clock()).total_seconds()

    def _otherwise(self, report: SiteReport) -> str:
        """What it tells otherwise than before, in words; empty when nothing."""
        if self._reported is None:
            return ""
        (before_s, before), after_s = self._reported, self._ahead_s(report)
        if report.last_start and before.last_start is not None and report.last_start != before.last_start:
            return tr("it tells of a new start")
        if before_s is not None and after_s is not None and abs(after_s - before_s) > JUMPED_S:
            return tr("its clock is {time}", time=f"{report.time_utc:%Y-%m-%d %H:%M}")
        if report.site is not None and before.site is not None and _apart_deg(report.site, before.site) > SITE_DEG:
            return tr("its site is {site}", site=site_text(report.site))
        return ""

    def _sentence(self, mount: Mount) -> str:
        commands = tr(" and ").join(COMMANDS[ability] for ability in self.wrong)
        able = not self.wrong.keys() & mount.lacks.keys()
        where = tr("in the Mount view, or by {commands}", commands=commands) if able else tr("on its hand control")
        return tr_n(
            "The mount contradicts this computer: {wrong}. Before a slew or a sync set it {where}; or say that the"
            " mount is right (--trust-mount).",
            "The mount contradicts this computer: {wrong}. Before a slew or a sync set them {where}; or say that the"
            " mount is right (--trust-mount).",
            len(self.wrong),
            wrong=tr(" and ").join(self.wrong.values()),
            where=where,
        )

    def _clock(self, report: SiteReport) -> str:
        ahead_s = self._ahead_s(report)
        if ahead_s is None:
            return ""
        size_s = abs(ahead_s)
        if size_s <= CLOCK_S:
            return ""
        if size_s > 1.5 * DAY_S:  # no time zone explains it: the date is wrong
            return tr("its date is {date}", date=f"{report.time_utc:%Y-%m-%d}")
        zone = tr(" (summer time or zone?)") if abs(size_s - ZONE_S * round(size_s / ZONE_S)) < CLOCK_S else ""
        size = (
            tr("{hours:.1f} h", hours=size_s / HOUR_S)
            if size_s >= HOUR_S - CLOCK_S
            else tr("{minutes:.0f} min", minutes=size_s / 60.0)
        )
        text = tr("its clock is {size} fast{zone}") if ahead_s > 0 else tr("its clock is {size} slow{zone}")
        return text.format(size=size, zone=zone)

    def _site(self, report: SiteReport) -> str:
        if report.site is None or self._policy.site is None:
            return ""
        if _apart_deg(report.site, self._policy.site) <= SITE_DEG:
            return ""
        return tr("its site is {site}, not {site2}", site=site_text(report.site), site2=site_text(self._policy.site))


def _apart_deg(one: Site, other: Site) -> float:
    # As an angle on the sphere: longitudes 180 and -180 are the same place.
    return apart_deg((one.longitude_deg, one.latitude_deg), (other.longitude_deg, other.latitude_deg))


def wall_clock(now_utc: datetime) -> datetime:
    """The time as this computer's zone has it; universal time where a mount's whole hours can't say the zone."""
    local = now_utc.astimezone()
    whole = not (local.utcoffset() or timedelta()) % timedelta(hours=1)
    return local if whole else now_utc.astimezone(UTC)
