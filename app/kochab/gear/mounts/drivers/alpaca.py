"""A mount driven through an ASCOM Alpaca server, so that other programs can use it too."""

from collections.abc import Mapping
from contextlib import closing, suppress
from datetime import UTC, datetime
from typing import Any, ClassVar, TypeVar, Unpack

from kochab.core.errors import LineLostError, NoAnswerError, PortError, RefusedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, Epoch, MountState, PierSide, Pointing, SiteReport, TrackingRate
from kochab.gear.mounts import Diagnosis, MountSettings
from kochab.gear.mounts.drivers.server_mount import ServerMount, site_of
from kochab.gear.servers.address import chosen, making_sense, net_address, server_text
from kochab.gear.servers.alpaca_link import ANSWER_S, PORT, AlpacaLink, discover
from kochab.text.translation import tr, tr_noop

T = TypeVar("T")

POWER_UP_S = 20.0
EPOCHS = {2: Epoch.J2000}  # ``EquatorialSystem``; 0 is unknown and 1 topocentric, the epoch of date
SIDES = {0: PierSide.EAST, 1: PierSide.WEST}
DIRECTIONS = (Direction.NORTH, Direction.SOUTH, Direction.EAST, Direction.WEST)
RATES = (TrackingRate.SIDEREAL, TrackingRate.LUNAR, TrackingRate.SOLAR, TrackingRate.KING)  # ``DriveRates``
GERMAN = 2  # ``AlignmentMode``
ALT_AZIMUTH = {0: True, 1: False, GERMAN: False}
CAN = {
    Ability.SYNC: "cansync",
    Ability.GOTO: "canslewasync",
    Ability.PULSE: "canpulseguide",
    Ability.TRACKING: "cansettracking",
}


NOT_BY_ALPACA = tr_noop("Kochab does not do this over Alpaca: use the hand control or the server's own menu.")


class AlpacaMount(ServerMount):
    """The telescope at ``host:port/number``; its number may be left out when there is one only.

    Every exchange has a connection of its own, so that Stop never waits behind another.
    """

    name: ClassVar[str] = "alpaca"
    title: ClassVar[str] = "ASCOM Alpaca server"
    ends_alone: ClassVar[bool] = True

    @making_sense()
    def __init__(self, address: str, **settings: Unpack[MountSettings]) -> None:
        self._where = where = net_address(address, PORT)
        self._open = True
        self._link = AlpacaLink(where, "telescope")
        try:
            self._start(settings)
        except BaseException:
            self._leave()
            raise

    def _start(self, settings: MountSettings) -> None:
        """Find the telescope and what it can do."""
        where = self._where
        telescopes = [(str(number), name) for number, name in self._link.devices()]
        self._path = f"telescope/{chosen(telescopes, where, 'Alpaca', 'telescope')}/"
        self._put("connected", POWER_UP_S, Connected=True)
        epoch = self._one_of(EPOCHS, "equatorialsystem") or Epoch.DATE
        super().__init__(settings.get("epoch") or epoch, self._leave)
        for ability, name in CAN.items():
            if not self._get(name, False):
                why = tr("The mount's Alpaca driver reports that it cannot do this ({name} is false).", name=name)
                self._lacks[ability] = why
        offered = self._get("trackingrates", None) or [0]  # without a list: sidereal
        for number, rate in enumerate(RATES):
            if Ability.TRACKING in self._lacks or number not in offered:
                self._lacks[rate.ability] = tr_noop("The mount's Alpaca driver has no command for this rate.")
        for ability in (Ability.PARK, Ability.UNPARK, Ability.HOME):  # older drivers block until they are there
            self._lacks[ability] = NOT_BY_ALPACA
        if Ability.GOTO in self._lacks:  # a move is a short slew here
            self._lacks[Ability.MOVE] = self._lacks[Ability.GOTO]
        for reporting, setting, name, why in (
            (
                Ability.SITE,
                Ability.SET_SITE,
                "sitelatitude",
                tr_noop("The mount's Alpaca driver does not report its site."),
            ),
            (
                Ability.TIME,
                Ability.SET_CLOCK,
                "utcdate",
                tr_noop("The mount's Alpaca driver does not report its time."),
            ),
        ):
            if self._get(name, None) is None:
                self._lacks |= {reporting: why, setting: why}

    @classmethod
    def found(cls, address: str) -> list[Diagnosis]:
        """The telescopes of a server, by default of all that answer on the network."""
        servers = [address] if address else discover()
        found = []
        for where in (net_address(server, PORT) for server in servers):
            with suppress(NoAnswerError, PortError), closing(AlpacaLink(where, "telescope")) as link:
                found += [Diagnosis(f"{where.server}/{n}", cls.name, name=name) for n, name in link.devices()]
        return found

    def identify(self) -> str:
        """Its name on the server."""
        return server_text(str(self._get("name", "Alpaca telescope")))

    @making_sense()
    def read_position(self) -> Pointing:
        """``RightAscension`` and ``Declination``."""
        ra, dec = float(self._get("rightascension")), float(self._get("declination"))
        if not (0.0 <= ra <= 24.0 and abs(dec) <= 90.0):
            raise NoAnswerError("The mount reports no valid position: {ra:g} h, {dec:g}°.", ra=ra, dec=dec)
        return Pointing(ra * 15.0 % 360.0, dec, self.epoch)

    @making_sense()
    def state(self) -> MountState:
        """As the server shows it, and whoever else moves the mount."""
        return MountState(
            slewing=self._truth("slewing"),
            parked=self._truth("atpark"),
            tracking=self._truth("tracking"),
            at_home=self._truth("athome"),
            rate=self._one_of(dict(enumerate(RATES)), "trackingrate"),
            pier_side=self._one_of(SIDES, "sideofpier"),
            alt_azimuth=self._one_of(ALT_AZIMUTH, "alignmentmode"),
        )

    def _truth(self, name: str) -> bool | None:
        """A property that is true or false; None where the mount has it not, or it is null or anything else."""
        value = self._get(name, None)
        return value if isinstance(value, bool) else None

    def _one_of(self, table: Mapping[int, T], name: str) -> T | None:
        """What the number of a property stands for; None where it stands for nothing, or is none."""
        value = self._get(name, None)
        return table.get(value) if isinstance(value, int) and not isinstance(value, bool) else None

    @making_sense()
    def altaz_deg(self) -> tuple[float, float] | None:
        """Altitude and azimuth where it reports them."""
        altitude, azimuth = self._get("altitude", None), self._get("azimuth", None)
        if altitude is None or azimuth is None:
            return None
        if not (abs(float(altitude)) <= 90.0 and abs(float(azimuth)) <= 360.0):
            raise NoAnswerError(
                "The mount reports no valid altitude and azimuth: {altitude}°, {azimuth}°.",
                altitude=altitude,
                azimuth=azimuth,
            )
        return float(altitude), float(azimuth)

    @making_sense()
    def site_report(self) -> SiteReport:
        """Its site and its clock, in universal time."""
        latitude, longitude = self._get("sitelatitude", None), self._get("sitelongitude", None)
        site = None
        if latitude is not None and longitude is not None:
            site = site_of(float(latitude), float(longitude), float(self._get("siteelevation", 0.0)))
        utc = self._get("utcdate", None)
        if not utc:
            return SiteReport(site, None)
        return SiteReport(site, datetime.fromisoformat(str(utc).strip().rstrip("Z")).replace(tzinfo=UTC))

    def set_site(self, site: Site) -> None:
        """``SiteLatitude`` and ``SiteLongitude``, which some drivers only report."""
        self.require(Ability.SET_SITE)
        self._put("sitelatitude", SiteLatitude=site.latitude_deg)
        self._put("sitelongitude", SiteLongitude=site.longitude_deg)

    def set_clock(self, now: datetime) -> None:
        """``UTCDate``, which some drivers only report."""
        self.require(Ability.SET_CLOCK)
        self._put("utcdate", UTCDate=f"{now.astimezone(UTC):%Y-%m-%dT%H:%M:%S.%f}Z")

    def sync(self, ra_deg: float, dec_deg: float) -> None:
        """``SyncToCoordinates``."""
        self.require(Ability.SYNC)
        self._put("synctocoordinates", ANSWER_S, **_place(ra_deg, dec_deg))

    def goto(self, ra_deg: float, dec_deg: float) -> None:
        """``SlewToCoordinatesAsync``, for which the mount has to track."""
        self.require(Ability.GOTO)
        with self.moving() as check:
            # ASCOM forbids a slew in equatorial coordinates while Tracking is false.
            if Ability.TRACKING not in self._lacks and not self._get("tracking"):
                self._put("tracking", Tracking=True)
            check()
            self._put("slewtocoordinatesasync", ANSWER_S, **_place(ra_deg, dec_deg))

    def halt(self) -> None:
        """``AbortSlew``, over a connection of its own."""
        # The other link may be waiting for an answer in another thread.
        with closing(AlpacaLink(self._where, "telescope")) as link:
            try:
                link.put(self._path + "abortslew", {})
            except RefusedError:
                if link.get(self._path + "slewing") is not False:
                    raise  # otherwise nothing moves: a parked mount may refuse, too

    def pulse(self, direction: Direction, milliseconds: int) -> None:
        """The server itself ends it."""
        self.require(Ability.PULSE)
        self._put("pulseguide", Direction=DIRECTIONS.index(direction), Duration=milliseconds)

    def move(self, direction: Direction, rate_deg_s: float, seconds: float) -> None:
        """By as much, as a slew that ends by itself: which way Alpaca's MoveAxis turns, its drivers do not tell."""
        self.require(Ability.MOVE)
        here, angle = self.position(), rate_deg_s * seconds
        sign = 1.0 if direction in (Direction.NORTH, Direction.EAST) else -1.0
        ra, dec = here.ra_deg, here.dec_deg
        if direction.in_dec:
            dec = max(-90.0, min(90.0, dec + sign * angle))
        else:
            ra = (ra + sign * angle) % 360.0
        if self._would_flip(ra, dec):
            raise RefusedError("The mount would flip on this move: slew across the meridian instead.")
        self.goto(ra, dec)

    @making_sense()
    def _would_flip(self, ra_deg: float, dec_deg: float) -> bool:
        if int(self._get("alignmentmode", GERMAN)) != GERMAN:  # if not reported, assume German
            return False
        try:
            after = self._link.get(f"{self._path}destinationsideofpier", query=_place(ra_deg, dec_deg))
        except RefusedError as error:
            raise RefusedError("The mount does not tell whether it would flip on this move: slew instead.") from error
        finally:
            self._link.close()
        return int(after) != int(self._get("sideofpier", -1))

    def track(self, rate: TrackingRate) -> None:
        """The rate, then tracking on."""
        self.require(rate.ability)
        if rate in RATES and self._get("trackingrate", 0) != RATES.index(rate):
            self._put("trackingrate", TrackingRate=RATES.index(rate))
        self._put("tracking", Tracking=rate is not TrackingRate.OFF)

    def _leave(self) -> None:
        self._open = False
        self._link.close()

    def _get(self, name: str, *default: Any) -> Any:
        """A property, or the ``default``, where there is one, of a mount that has it not or not just now."""
        self._check()
        try:
            return self._link.get(self._path + name)
        except RefusedError:
            if not default:
                raise
            return default[0]
        finally:
            self._link.close()

    def _put(self, name: str, limit_s: float = ANSWER_S, /, **values: object) -> None:
        self._check()
        try:
            self._link.put(self._path + name, values, limit_s)
        finally:
            self._link.close()

    def _check(self) -> None:
        if not self._open:
            raise LineLostError("The connection was closed.")


def _place(ra_deg: float, dec_deg: float) -> dict[str, object]:
    return {"RightAscension": f"{ra_deg / 15.0 % 24.0:.9f}", "Declination": f"{dec_deg:.8f}"}
