"""A mount driven through an INDI server, so that other programs can use it too."""

from contextlib import ExitStack, closing
from datetime import UTC, datetime, timedelta
from math import asin, copysign, cos, degrees, inf, radians, sin
from time import monotonic
from typing import ClassVar, Unpack

from kochab.core.attitude import apart_deg
from kochab.core.errors import NoAnswerError, NotSentError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import (
    SIDEREAL_DEG_S,
    Ability,
    Direction,
    Epoch,
    MountState,
    PierSide,
    Pointing,
    SiteReport,
    TrackingRate,
)
from kochab.gear.mounts import Diagnosis, MountSettings
from kochab.gear.mounts.drivers.indi_last_heard import NEWS_S, LastHeard, only_listens
from kochab.gear.mounts.drivers.server_mount import ServerMount, site_of
from kochab.gear.mounts.standing import STILL_DEG
from kochab.gear.servers.address import chosen, making_sense, net_address
from kochab.gear.servers.indi_link import CALL_S, PORT, POWER_UP_S, SET_S, TELESCOPE_INTERFACE, IndiDevice, IndiLink
from kochab.text.translation import tr, tr_noop

STOP_S = 1.0  # how long a driver may take to acknowledge a Stop before it is sent again
SETTLES_S = 3.0  # after a motion its position is not trusted before the driver has asked the mount again
MORE_S = 0.3
LATE_S = 1.5  # how late a driver's report may be on a busy computer
NEAR_DEG = 0.02
MOVES_DEG = 0.05  # what a place changes by beyond drifting; a StarBook tells steps of 0.025
ABOUT_DEG = 0.1  # as near the target a short goto may have ended before it was seen to begin
BEGINS_S = 5.0  # by then a goto or a refused one shows: INDI's EXOS-2 driver is two reports behind its mount
SLOW_S = 3.0  # a driver that takes an order later has waited for its mount, which may have lost its power
RESTS_S = 10.0  # a mount that stands so long has come to its park position, whatever its driver still waits for
KNOWN = ("Idle", "Ok", "Busy", "Alert")
PLACES = {"EQUATORIAL_EOD_COORD": Epoch.DATE, "EQUATORIAL_COORD": Epoch.J2000}
MOVES = "TELESCOPE_MOTION_NS", "TELESCOPE_MOTION_WE"
PARTS = {
    Ability.SYNC: ("ON_COORD_SET", "SYNC"),
    Ability.GOTO: ("ON_COORD_SET", "TRACK"),
    Ability.STOP: ("TELESCOPE_ABORT_MOTION", "ABORT"),
    Ability.PULSE: ("TELESCOPE_TIMED_GUIDE_NS", "TIMED_GUIDE_N"),
    Ability.MOVE: ("TELESCOPE_MOTION_NS", "MOTION_NORTH"),
    Ability.TRACKING: ("TELESCOPE_TRACK_STATE", "TRACK_ON"),
    **{rate.ability: ("TELESCOPE_TRACK_MODE", f"TRACK_{rate.name}") for rate in TrackingRate if rate.name != "OFF"},
    Ability.PARK: ("TELESCOPE_PARK", "PARK"),
    Ability.UNPARK: ("TELESCOPE_PARK", "UNPARK"),
    Ability.SITE: ("GEOGRAPHIC_COORD", "LAT"),
    Ability.TIME: ("TIME_UTC", "UTC"),
    Ability.SET_SITE: ("GEOGRAPHIC_COORD", "LAT"),
    Ability.SET_CLOCK: ("TIME_UTC", "UTC"),
}
"""Where a driver that has the ability shows it."""
SPEEDS = ((0.02, 0.0), (0.3, 1.0 / 3.0), (1.5, 2.0 / 3.0), (inf, 1.0))
"""Degrees a second below which -> the place among a driver's slew rates, whose speed INDI does not tell."""


ABORT: tuple[str, dict[str, str]] = "TELESCOPE_ABORT_MOTION", {"ABORT": "On"}
MOTIONS = frozenset(("goto", "park", "move"))
HEARS_NOTHING = tr_noop(
    "INDI repeats the last place of {name} and hears nothing new: is the mount switched on? If it is, move it a little"
    " by its hand control."
)
WOKE_UP = tr_noop(
    "{name} now says that it is {jump:.0f}° from the place that INDI repeated: was it switched off and on? Nothing was"
    " sent."
)
NO_PART = tr_noop("{name} has no {part} in INDI: use its hand control.")


class IndiMount(ServerMount):
    """The telescope at ``host:port/name``; its name may be left out when there is one only."""

    name: ClassVar[str] = "indi"
    title: ClassVar[str] = "INDI server"

    @making_sense()
    def __init__(self, address: str, **settings: Unpack[MountSettings]) -> None:
        where = net_address(address, PORT)
        with ExitStack() as failing:
            self._link = link = IndiLink(where)
            failing.callback(link.close)
            names = [(name, name) for name in link.named(TELESCOPE_INTERFACE, where.rest)]
            self._device = device = IndiDevice(link, chosen(names, where, "INDI", "telescope"))
            begun = monotonic()
            new = device.power_up()
            # A driver defines its properties one by one and never says which is the last: wait until no more come.
            link.wait(lambda: monotonic() - max(link.defined_s, begun) > MORE_S and self._place() in PLACES, CALL_S)
            self._at = self._place()
            silent = NoAnswerError(
                "{name} on {server} does not report where it points.", name=device.name, server=where.server
            )
            if not self._at:
                raise silent
            super().__init__(settings.get("epoch") or PLACES[self._at], link.close)
            self._poll_s = min(CALL_S, (device.number("POLLING_PERIOD", "PERIOD_MS") or 1000.0) / 1000.0 + LATE_S)
            self.lag_s = self._poll_s
            self._unsettled_s = self._refused_s = 0.0
            self._looked_s = monotonic()
            self._heard = LastHeard(device, self._at) if only_listens(device) else None
            self._parked = False  # as it was last seen
            self._goes: tuple[float, float, float] | None = None  # when a goto of ours was sent, and where to
            self._moved_s = 0.0  # when its place was last seen to change
            self._was: tuple[float, float, float] | None = None  # when it was at an earlier place, and that place
            asked = monotonic()  # a driver just connected, or told its site, still reports an older position

            def unread() -> bool:
                return new and not any(device.number(self._at, member) for member in ("RA", "DEC"))

            patience_s = POWER_UP_S if unread() else CALL_S if new else self._poll_s
            # LX200 Basic tells of 0 h, 0 deg while it connects, before it has asked its mount.
            link.wait(lambda: bool(self._states_since(self._at, asked)) and not unread(), patience_s)
            if unread() and not self._states_since(self._at, asked):
                raise silent
            if new:  # INDI's EXOS-2 driver has no goto before it has seen that its mount tracks
                link.wait(lambda: device.state(self._at) != "Idle", BEGINS_S)
            for ability, part in PARTS.items():
                if device.value(*part) is None:
                    self._lacks[ability] = tr(NO_PART, name=device.name, part=".".join(part))
            self._lacks[Ability.HOME] = tr_noop("INDI's drivers have no home in common: use the hand control.")
            if Ability.TRACKING not in self._lacks and device.state("TELESCOPE_TRACK_MODE") is None:
                del self._lacks[Ability.SIDEREAL]  # the only rate
            if Ability.STOP in self._lacks:  # nothing may begin that cannot be ended
                self._lacks |= dict.fromkeys((Ability.GOTO, Ability.MOVE), self._lacks[Ability.STOP])
            failing.pop_all()

    @classmethod
    def found(cls, address: str) -> list[Diagnosis]:
        """The telescopes of a server, by default of one on this computer."""
        where = net_address(address, PORT)
        with closing(IndiLink(where)) as link:
            return [Diagnosis(f"{where.server}/{n}", cls.name, name=n) for n in link.named(TELESCOPE_INTERFACE)]

    def identify(self) -> str:
        """Its name on the server."""
        return self._device.name

    @making_sense()
    def read_position(self) -> Pointing:
        """What the driver last read of the mount; while something may move, what it reads next."""
        self._device.check()
        self._require_awake()
        self._require_news()
        asked = monotonic()
        self._count_missed(asked)
        # A driver reports a place about once a second: what it has now may be older than the motion.
        if asked < self._unsettled_s or self._device.state(self._at) == "Busy":
            self._link.wait(lambda: bool(self._states_since(self._at, asked)), self._poll_s)
        # An Alert that only answered a refused order says nothing about the place.
        if self._device.state(self._at) == "Alert" and self._states_since(self._at, self._refused_s):
            raise NoAnswerError(
                "{name} gets no position from its mount{message}.",
                name=self._device.name,
                message=self._device.message(),
            )
        ra, dec = (self._device.number(self._at, member) for member in ("RA", "DEC"))
        if ra is None or dec is None or not (abs(ra) <= 24.0 and abs(dec) <= 180.0):
            raise NoAnswerError("{name} reports no valid position.", name=self._device.name)
        ra_deg = ra * 15.0
        if abs(dec) > 90.0:  # EQMod counts on beyond the pole: that is a place on the other side
            ra_deg, dec = ra_deg + 180.0, copysign(180.0, dec) - dec
        return Pointing(ra_deg % 360.0, dec, self.epoch)

    def _require_awake(self) -> None:
        """Raise `NoAnswerError` when the driver waits for its mount: what it has told is older than that.

        A driver that says nothing because nothing changes answers at once.
        """
        vector = "ON_COORD_SET"
        if monotonic() - self._link.spoke_s(self._device.name) < self._poll_s:
            return
        on = next((m for m in self._link.members(self._device.name, vector) if self._on(vector, m)), "")
        if not on:
            return
        sent = self._device.send(vector, {on: "On"})  # as it is: nothing changes by it
        if not self._link.wait(lambda: bool(self._states_since(vector, sent)), CALL_S):
            raise NoAnswerError("{name} does not answer: is its mount switched on?", name=self._device.name)

    def _require_news(self) -> None:
        """Raise `NoAnswerError` where a driver that only listens hears nothing of a mount that must tell of news."""
        heard = self._heard
        if heard is None or heard.look():
            return
        if not heard.deaf and self._device.state(self._at) == "Busy" and monotonic() - heard.at_s > NEWS_S:
            heard.deaf = True
            self.missed += 1
        if heard.deaf and not self._asked_anew(heard):
            raise NoAnswerError(HEARS_NOTHING, name=self._device.name)

    def _asked_anew(self, heard: LastHeard) -> bool:
        """Whether the mount tells where it is once it has got a Stop, by which one that woke up begins to tell.

        Twice: the first may be a place that the driver heard before, and withheld for it had changed so little.
        """
        self._device.send(*ABORT)
        return heard.news(NEWS_S) and heard.news(NEWS_S)

    def _require_heard(self) -> None:
        """Before an order by which the mount goes far: `NotSentError` where nobody knows whether it is there still.

        A driver that only listens repeats the last place of a mount that lost its power. One that tracks tells of
        nothing new either; stopped, it drifts, and one that was switched off and on tells of its home.
        """
        heard = self._heard
        if heard is None:
            return
        heard.look()
        before = heard.mark()
        drifts = self._device.state(self._at) != "Ok" and heard.news(NEWS_S / 2.0)
        if not drifts and not self._asked_anew(heard):
            heard.deaf = True
            self.missed += 1
            raise NotSentError(HEARS_NOTHING, name=self._device.name)
        if jump_deg := heard.jumped_deg(before):
            self.missed += 1
            raise NotSentError(WOKE_UP, name=self._device.name, jump=jump_deg)

    def _count_missed(self, now: float) -> None:
        """Since the last look the driver may have failed to read its mount, and have read it again meanwhile."""
        since, self._looked_s = max(self._looked_s, self._refused_s), now
        if self._device.state(self._at) != "Alert":  # one that lasts is counted where the place is asked for
            self.missed += sum(state == "Alert" for _, state in self._states_since(self._at, since))

    def state(self) -> MountState:
        """As the driver shows it, and whoever else moves the mount."""
        self._device.check()
        state, on = self._device.state, self._on
        states = [state(vector) for vector in (self._at, *MOVES, "TELESCOPE_PARK")]
        silent = states[0] not in KNOWN or (
            states[0] == "Alert" and bool(self._states_since(self._at, self._refused_s))
        )
        slewing = True if "Busy" in states else None if silent else False
        parked = on("TELESCOPE_PARK", "PARK")
        stood_s = self._stood_s()
        if self._goes and slewing is False:
            # INDI's EXOS-2 driver calls a slew over as soon as one report of it differs little in RA from the last.
            slewing = self._runs_on(*self._goes)
            self._goes = self._goes if slewing else None
        if parked and states[0] == "Busy" and "Busy" not in states[1:] and stood_s > RESTS_S:
            slewing = False  # the same driver waits for a place that stands, and RA never does where nothing tracks
        if parked and slewing is not True and not self._rests():
            parked, slewing = False, True
        self._parked = bool(parked)
        rates = [rate for rate in TrackingRate if on("TELESCOPE_TRACK_MODE", f"TRACK_{rate.name}")]
        sides = [side for side in PierSide if on("TELESCOPE_PIER_SIDE", f"PIER_{side.name}")]
        return MountState(
            slewing=slewing,
            parked=parked and state("TELESCOPE_PARK") != "Busy",
            tracking=on("TELESCOPE_TRACK_STATE", "TRACK_ON"),
            pier_side=sides[0] if len(sides) == 1 else None,  # both are off if the driver doesn't know
            alt_azimuth=on("MOUNT_TYPE", "ALTAZ") or on("MOUNT_TYPE", "MOUNT_TYPE_ALTAZ") or None,  # else a default
            rate=rates[0] if len(rates) == 1 else None,
        )

    def _stood_s(self) -> float:
        """How long its place has not changed by more than the sky turns."""
        ra, dec = self._device.number(self._at, "RA"), self._device.number(self._at, "DEC")
        now = monotonic()
        if ra is not None and dec is not None:
            here, was = (ra * 15.0, dec), self._was
            drift_deg = MOVES_DEG + 2.0 * SIDEREAL_DEG_S * (now - was[0]) if was else 0.0
            if was is None or apart_deg(here, was[1:]) > drift_deg:
                self._was, self._moved_s = (now, *here), now if was else self._moved_s
        return now - self._moved_s

    def _runs_on(self, sent_s: float, ra_deg: float, dec_deg: float) -> bool:
        """Whether a goto that its driver calls over goes on by its place, or is yet to begin."""
        ra, dec = self._device.number(self._at, "RA"), self._device.number(self._at, "DEC")
        near = ra is not None and dec is not None and apart_deg((ra * 15.0, dec), (ra_deg, dec_deg)) < ABOUT_DEG
        since_s = max(self._moved_s, sent_s)
        return monotonic() - since_s < (self._poll_s if near or self._moved_s > sent_s else BEGINS_S)

    def _moved_since(self, since_s: float) -> bool:
        self._stood_s()
        return self._moved_s > since_s

    def _rests(self) -> bool:
        """Whether a mount that is said to be parked stands: INDI's OnStep says so while its board still runs there."""
        if self._parked:
            return True
        (ra, dec), (next_ra, next_dec) = self._next_place(), self._next_place()
        if ra is None or dec is None or next_ra is None or next_dec is None:
            return False
        # What is parked does not track: its right ascension goes on with the stars.
        return (
            apart_deg((ra * 15.0, dec), (next_ra * 15.0, next_dec)) <= STILL_DEG + 2.0 * SIDEREAL_DEG_S * self._poll_s
        )

    def _next_place(self) -> tuple[float | None, float | None]:
        """Hours and degrees as they are told next; what is not told anew has not changed."""
        asked = monotonic()
        self._link.wait(lambda: bool(self._states_since(self._at, asked)), self._poll_s)
        return self._device.number(self._at, "RA"), self._device.number(self._at, "DEC")

    def altaz_deg(self) -> None:
        """Drivers reckon it from the right ascension themselves, if at all."""

    @making_sense()
    def site_report(self) -> SiteReport:
        """The driver's site, and its time where it was set since this mount was opened: INDI's does not run."""
        number = self._device.number
        latitude, longitude = number("GEOGRAPHIC_COORD", "LAT"), number("GEOGRAPHIC_COORD", "LONG")
        site = None  # a driver that was never told its site reports 0, 0
        if latitude is not None and longitude is not None and (latitude or longitude):
            site = site_of(latitude, longitude, number("GEOGRAPHIC_COORD", "ELEV") or 0.0)
        utc, offset = self._device.value("TIME_UTC", "UTC"), self._device.value("TIME_UTC", "OFFSET")
        messages, time_utc = self._states_since("TIME_UTC", 0.0), None
        if utc and messages:
            time_utc = datetime.fromisoformat(utc.strip()).replace(tzinfo=UTC)
            time_utc += timedelta(seconds=monotonic() - messages[-1][0])
        return SiteReport(site, time_utc, float(offset) if offset and offset.strip() else None)

    def set_site(self, site: Site) -> None:
        """``GEOGRAPHIC_COORD``, whose longitudes grow eastward to 360."""
        self.require(Ability.SET_SITE)
        place = {"LAT": site.latitude_deg, "LONG": site.longitude_deg % 360.0, "ELEV": site.height_m}
        self._begin("GEOGRAPHIC_COORD", {name: f"{value:.7f}" for name, value in place.items()}, "site")

    def set_clock(self, now: datetime) -> None:
        """``TIME_UTC`` and the zone."""
        self.require(Ability.SET_CLOCK)
        zone = (now.utcoffset() or timedelta()) / timedelta(hours=1)
        utc = f"{now.astimezone(UTC):%Y-%m-%dT%H:%M:%S}"
        self._begin("TIME_UTC", {"UTC": utc, "OFFSET": f"{zone:g}"}, "time")

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """``ON_COORD_SET`` to ``SYNC``, then the coordinates."""
        self._aim(Ability.SYNC, ra_deg, dec_deg)

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """``ON_COORD_SET`` to ``TRACK``, then the coordinates."""
        self._aim(Ability.GOTO, ra_deg, dec_deg)

    def _aim(self, ability: Ability, ra_deg: float, dec_deg: float) -> None:
        """Send coordinates and wait until the driver shows that it takes them."""
        self.require(ability)
        vector, switch = PARTS[ability]
        with self.moving() as check:
            if ability is Ability.GOTO:
                self._require_heard()
            if not self._on(vector, switch):
                self._device.set(vector, {switch: "On"}, str(ability))
            check()
            self._stood_s()  # from here on every change counts
            sent = self._device.send(self._at, {"RA": f"{ra_deg / 15.0:.9f}", "DEC": f"{dec_deg:.8f}"})
            self._unsettled_s = sent + SETTLES_S

            def taken() -> bool:
                states = {state for _, state in self._states_since(self._at, sent)}
                if "Alert" in states or (ability is Ability.GOTO and "Busy" in states):
                    return True
                # A sync, or a goto so short that its Busy was missed, shows by the place itself.
                ra, dec = (self._device.number(self._at, member) for member in ("RA", "DEC"))
                there = ra is not None and dec is not None and apart_deg((ra * 15.0, dec), (ra_deg, dec_deg)) < NEAR_DEG
                return bool(states) and there

            took = self._link.wait(taken, SET_S)
            try:
                self._answered(self._at, sent, str(ability))
            except RefusedError as error:
                # INDI's EXOS-2 driver refuses after it has sent, where its table of states has no goto.
                if ability is Ability.GOTO and self._link.wait(lambda: self._moved_since(sent), BEGINS_S):
                    raise NoAnswerError("{error} The mount moves all the same.", error=error) from error
                raise
            if not took and ability is Ability.GOTO:
                raise RefusedError(
                    "{name} does not begin the goto{message}.", name=self._device.name, message=self._device.message()
                )
            if ability is Ability.GOTO:
                self._goes = sent, ra_deg, dec_deg

    def halt(self) -> None:
        """``TELESCOPE_ABORT_MOTION``, and the end of moves."""
        vector, member = PARTS[Ability.STOP]
        # ABORT makes every driver forget its moves, but INDI's for iOptron ends slews alone.
        moving = [axis for axis in MOVES if self._device.state(axis) not in (None, "Idle")]
        sent = self._device.send(vector, {member: "On"})
        for axis in moving:
            self._device.send(axis, dict.fromkeys(self._link.members(self._device.name, axis), "Off"))
        self._unsettled_s, self._goes = sent + SETTLES_S, None
        self._link.wait(lambda: bool(self._states_since(vector, sent)), STOP_S)
        try:
            self._answered(vector, sent, "stop")
        except RefusedError as error:  # so that the Stop is tried again
            raise NoAnswerError(str(error)) from error

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """The driver itself ends it."""
        self.require(Ability.PULSE)
        axis = "NS" if direction.in_dec else "WE"
        # One vector holds both directions of an axis: the other must be 0.
        members = {f"TIMED_GUIDE_{way}": "0" for way in axis} | {f"TIMED_GUIDE_{direction.name[0]}": str(milliseconds)}
        self._begin(f"TELESCOPE_TIMED_GUIDE_{axis}", members, "guide pulse")
        self._unsettled_s = monotonic() + milliseconds / 1000.0 + SETTLES_S

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """At the driver's slew rate that is likely nearest, ended by our own clock: INDI's moves do not end.

        Beyond the pole north is where the driver says; INDI's own simulator goes south there.
        """
        self.require(Ability.MOVE)
        self.watchdog.check()
        vector = f"TELESCOPE_MOTION_{'NS' if direction.in_dec else 'WE'}"
        member = f"MOTION_{direction.name}"
        with self.moving() as check:
            self._set_rate(rate_deg_s)
            check()
            self._unsettled_s = monotonic() + seconds + SETTLES_S
            with self.watchdog.bounding(vector, seconds, lambda: self._end_move(vector, member)):
                self._begin(vector, {member: "On"}, "move")

    def _end_move(self, vector: str, member: str) -> None:
        sent = self._device.send(vector, {member: "Off"})
        if not self._link.wait(lambda: bool(self._states_since(vector, sent)), STOP_S):
            raise NoAnswerError("{name} does not answer to the end of a move.", name=self._device.name)

    def _set_rate(self, rate_deg_s: float) -> None:
        rates = [m for m in self._link.members(self._device.name, "TELESCOPE_SLEW_RATE") if "CUSTOM" not in m]
        if rates:
            share = next(share for below, share in SPEEDS if rate_deg_s < below)
            rate = rates[round(share * (len(rates) - 1))]
            if not self._on("TELESCOPE_SLEW_RATE", rate):
                self._device.set("TELESCOPE_SLEW_RATE", {rate: "On"}, "slew rate")

    def track(self, rate: TrackingRate) -> None:
        """The rate, then tracking on."""
        self.require(rate.ability)
        # None if the driver offers no choice of rates.
        if self._on("TELESCOPE_TRACK_MODE", f"TRACK_{rate.name}") is False:
            self._begin("TELESCOPE_TRACK_MODE", {f"TRACK_{rate.name}": "On"}, "tracking rate")
        switch = "TRACK_OFF" if rate is TrackingRate.OFF else "TRACK_ON"
        self._begin("TELESCOPE_TRACK_STATE", {switch: "On"}, "change of tracking")

    def park(self) -> None:
        """``TELESCOPE_PARK``."""
        self.require(Ability.PARK)
        with self.moving():
            self._require_heard()
            self._begin("TELESCOPE_PARK", {"PARK": "On"}, "park")
            self._moved_s = monotonic()
            self._unsettled_s = self._moved_s + SETTLES_S

    @making_sense()
    def park_altitude_deg(self) -> float | None:
        """Of drivers that park by altitude or hour angle; others tell the counts of their encoders."""
        park = {name: self._device.number("TELESCOPE_PARK_POSITION", f"PARK_{name}") for name in ("ALT", "HA", "DEC")}
        latitude = self._device.number("GEOGRAPHIC_COORD", "LAT")
        # From hour angle and declination by the spherical triangle of pole, zenith and place.
        if park["ALT"] is not None or park["HA"] is None or park["DEC"] is None or latitude is None:
            return park["ALT"]
        hour, dec, north = map(radians, (park["HA"] * 15.0, park["DEC"], latitude))
        return degrees(asin(sin(north) * sin(dec) + cos(north) * cos(dec) * cos(hour)))

    def unpark(self) -> None:
        """The same."""
        self.require(Ability.UNPARK)
        if self._device.state(self._at) == "Busy" and self._stood_s() > RESTS_S:
            self.halt()  # INDI's EXOS-2 driver still parks, see :meth:`state`, and refuses to unpark meanwhile
        self._begin("TELESCOPE_PARK", {"UNPARK": "On"}, "unpark")

    def _begin(self, vector: str, members: dict[str, str], what: str) -> None:
        """Order something and see that the driver has taken it."""
        sent = self._device.send(vector, members)
        self._link.wait(lambda: bool(self._states_since(vector, sent)), SET_S)
        self._answered(vector, sent, what)

    def _answered(self, vector: str, sent_s: float, what: str) -> None:
        """Raise `DeviceError` when the driver has refused what was sent, taken it late, or not answered at all."""
        answers = self._states_since(vector, sent_s)
        words = {"name": self._device.name, "what": tr(what), "message": self._device.message()}
        if not answers:
            raise NoAnswerError("{name} does not answer to a {what} on its INDI server{message}.", **words)
        if "Alert" in (state for _, state in answers):
            self._refused_s = monotonic()
            raise RefusedError("{name} refuses the {what}{message}.", **words)
        if (late_s := answers[0][0] - sent_s) > SLOW_S:
            self.missed += 1
            if what in MOTIONS:  # INDI's StarGo driver sends on after its mount's silence, to one that just woke up
                raise NoAnswerError(
                    "{name} took {late:.0f} s to pass on the {what}: was its mount switched off and on?",
                    late=late_s,
                    **words,
                )

    def _states_since(self, vector: str, since_s: float) -> list[tuple[float, str]]:
        return self._link.heard_since(self._device.name, vector, since_s)

    def _on(self, vector: str, member: str) -> bool | None:
        value = self._device.value(vector, member)
        return {"On": True, "Off": False}.get(value or "")

    def _place(self) -> str:
        return next((vector for vector in PLACES if self._device.state(vector) is not None), "")
