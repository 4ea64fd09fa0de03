"""The mount's clock and site beside the computer's: what contradicts forbids slews and syncs."""

from datetime import UTC, datetime, timedelta

from kochab.core import tr, tr_n
from kochab.core.angle_text import site_text
from kochab.core.attitude import apart_deg
from kochab.core.errors import NoAnswerError
from kochab.core.mount import Ability, Mount, Pointing, SiteReport
from kochab.gear.mounts.motion_policy import MotionPolicy

CLOCK_S, SITE_DEG = 120.0, 0.5  # in two minutes the sky turns by half a degree, too
SHIFTED_DEG = 0.5  # a new clock or site that shifts the position by more calls for a sync
ASKED = 2  # unanswered questions after which the mount counts as not reporting them
COMMANDS = {Ability.SET_CLOCK: "kochab mount set-clock", Ability.SET_SITE: "kochab mount set-site"}
HOUR_S, ZONE_S, DAY_S = 3600.0, 1800.0, 86400.0  # nearly all time zones differ by multiples of half an hour


class ClockAndSite:
    """Tells the ``policy`` what a mount contradicts of the computer's clock and of the site."""

    def __init__(self, policy: MotionPolicy) -> None:
        self._policy = policy
        self.forget()

    def forget(self) -> None:
        """Compare again before the next slew: the site is another, or the mount was switched on again.

        A position that was lost is not found by that: only a sync or a person settles it.
        """
        self._left, self._trusted, self._policy.doubt = ASKED, False, ""
        self.wrong: dict[Ability, str] = {}  # what would mend it -> what is wrong

    def trust(self) -> None:
        """A person says that the mount is right."""
        self._trusted, self._policy.doubt, self._policy.until_sync = True, "", ""

    def shifted(self, before: Pointing, after: Pointing) -> None:
        """Its position, with a new clock or site: a sync before it was of the old one."""
        shift_deg = apart_deg((before.ra_deg, before.dec_deg), (after.ra_deg, after.dec_deg))
        if shift_deg > SHIFTED_DEG and not self._trusted:
            self._policy.until_sync = tr(
                "The mount's position shifted by {shift:.1f}° with its new clock or site. Sync on a "
                "solved frame before you slew, or say that the mount is right (--trust-mount).",
                shift=shift_deg,
            )

    def compare(self, mount: Mount) -> None:
        """Ask the mount, unless it agreed already: what contradicts may have been set on its hand control."""
        if not self._trusted and (self._left > 0 or self._policy.doubt):
            self.ask(mount)

    def ask(self, mount: Mount) -> str:
        """What contradicts now, in a sentence; empty when nothing does, or nothing is told."""
        try:
            report = mount.site_report()
        except NoAnswerError:
            self._left -= 1
            return self._policy.doubt
        self._left = 0  # it does report them: ask again only while they contradict
        said = {Ability.SET_CLOCK: self._clock(report), Ability.SET_SITE: self._site(report)}
        self.wrong = {ability: words for ability, words in said.items() if words and not self._trusted}
        self._policy.doubt = self._sentence(mount) if self.wrong else ""
        return self._policy.doubt

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
        if report.time_utc is None:
            return ""
        ahead_s = (report.time_utc - self._policy.clock()).total_seconds()
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
        # As an angle on the sphere: longitudes 180 and -180 are the same place.
        pairs = [(one.longitude_deg, one.latitude_deg) for one in (report.site, self._policy.site)]
        if apart_deg(*pairs) <= SITE_DEG:
            return ""
        return tr("its site is {site}, not {site2}", site=site_text(report.site), site2=site_text(self._policy.site))


def wall_clock(now_utc: datetime) -> datetime:
    """The time as this computer's zone has it; universal time where a mount's whole hours can't say the zone."""
    local = now_utc.astimezone()
    whole = not (local.utcoffset() or timedelta()) % timedelta(hours=1)
    return local if whole else now_utc.astimezone(UTC)
