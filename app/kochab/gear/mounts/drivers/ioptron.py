"""iOptron mounts with the version 3 language."""

from dataclasses import replace
from datetime import datetime

from kochab.core.errors import NoAnswerError
from kochab.core.frame import Site
from kochab.core.mount import SIDEREAL_DEG_S, Direction, MountState, Pointing, SiteReport, TrackingRate
from kochab.gear.mounts.drivers.serial_mount import SerialMount
from kochab.gear.mounts.protocols import ioptron as protocol
from kochab.gear.mounts.serial_line import Command
from kochab.text.translation import tr_noop


class Ioptron(SerialMount):
    """CEM, GEM and HAE mounts, over USB or their TCP port 8899."""

    name = "ioptron"
    title = "iOptron (version 3 language)"
    blind_stop = b"#" + b"".join(protocol.STOPS)
    bauds = (115200, 230400)
    tcp_port = 8899
    # Its ninth, "maximum", differs with the model: how far it would go, nobody could say before.
    rates_deg_s = tuple(k * SIDEREAL_DEG_S for k in (1, 2, 8, 16, 64, 128, 256, 512))

    def start(self) -> None:
        """Its model."""
        self.model = self.query(protocol.MOUNT_INFO, protocol.parse_model, 4)
        self.use_commands(protocol.COMMANDS, "")  # it has them all

    def identify(self) -> str:
        """The model."""
        return f"iOptron {self.model}"

    def read_position(self) -> protocol.PositionReply:
        """All of ``:GEP#``."""
        return self.query(protocol.POSITION, protocol.parse_position)

    def position(self) -> Pointing:
        """Where it says it points."""
        self.watchdog.check()
        place = self.read_position()
        return Pointing(place.ra_deg, place.dec_deg, self.epoch)

    def altaz_deg(self) -> tuple[float, float]:
        """Altitude and azimuth."""
        return self.query(protocol.ALTAZ, protocol.parse_altaz)

    def state(self) -> MountState:
        """``:GLS#``, and the pier side from ``:GEP#``."""
        state, side = self.query(protocol.STATUS, protocol.parse_status), self.read_position().pier_side
        return replace(state, pier_side=side, alt_azimuth=protocol.is_alt_azimuth(self.model))

    def site_report(self) -> SiteReport:
        """Site, zone and clock."""
        site = self.query(protocol.STATUS, protocol.parse_site)
        return SiteReport(site, *self.query(protocol.TIME, protocol.parse_time))

    def set_site(self, site: Site) -> None:
        """Latitude and longitude."""
        for command in protocol.set_site(site):
            self.require_accepted(command, tr_noop("The mount does not accept this site."))

    def set_clock(self, now: datetime) -> None:
        """The zone, then universal time."""
        for command in protocol.set_clock(now):
            self.require_accepted(command, tr_noop("The mount does not accept this time."))

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then match it."""
        self.set_target(ra_deg, dec_deg)
        self.require_accepted(protocol.SYNC, tr_noop("The mount refuses the sync."))

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """Set the target, then slew."""
        since = self.talk.stops
        self.set_target(ra_deg, dec_deg)
        self.require_accepted(protocol.SLEW, tr_noop("The mount refuses to go there: outside its limits."), since)

    def set_target(self, ra_deg: float, dec_deg: float) -> None:
        """Both coordinates."""
        for command in (protocol.set_ra(ra_deg), protocol.set_dec(dec_deg)):
            self.require_accepted(command, tr_noop("The mount does not accept these coordinates."))

    def stop_commands(self) -> list[Command]:
        """End a slew, and moves on both axes."""
        return [(command, (self.stop_reply(1),)) for command in protocol.STOPS]

    def park_altitude_deg(self) -> float | None:
        """``:GPC#``; None from a mount that does not answer it."""
        try:
            return self.query(protocol.PARK_PLACE, protocol.parse_park_altitude)
        except NoAnswerError:
            return None

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """The mount itself ends it."""
        self.talk.send(protocol.pulse(direction, milliseconds))

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """At the nearest of its eight rates that are known."""
        since = self.talk.stops
        rate = protocol.move_rate(self.nearest_rate(rate_deg_s) + 1)
        self.require_accepted(rate, tr_noop("The mount does not accept this rate."))
        # One axis alone: the other may be moving, too.
        halt = protocol.HALT_DEC if direction.in_dec else protocol.HALT_RA
        with self.bounded(direction, seconds, (halt, (self.stop_reply(1),))):
            self.talk.send(protocol.move(direction), since)

    def track(self, rate: TrackingRate) -> None:
        """The rate, then tracking on."""
        # :RTn# only chooses the rate.
        super().track(rate)
        if rate is not TrackingRate.OFF:
            self.require_accepted(protocol.TRACK_ON, tr_noop("The mount refuses to track."))
