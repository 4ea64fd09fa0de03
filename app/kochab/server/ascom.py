"""``kochab serve --ascom``: a mount's ASCOM driver of this Windows as an Alpaca telescope.

Most mounts on Windows have a driver that is a COM object. It is loaded here, in a process of its own, and served at a
port of this computer, where Kochab's Alpaca driver reaches it with all its limits and its Stop; a driver that hangs
keeps nobody else waiting. Only what :data:`READ`, :data:`WRITTEN` and :data:`CALLED` name is passed on: no dialog, no
raw command. Facts: ASCOM's ``ITelescopeV3`` and its error codes; [MS-OAUT] for ``IDispatch``.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from http import HTTPStatus
from itertools import count
from typing import Any, Protocol

from kochab.core import __version__
from kochab.core.errors import PortError, UsageError
from kochab.server.alpaca_words import (
    METHODS,
    NOT_CONNECTED,
    NOT_IMPLEMENTED,
    VALUE_NOT_SET,
    WRONG_METHOD,
    BadRequest,
    Fault,
    envelope,
    truth,
    whole,
)
from kochab.server.alpaca_words import number as number_of
from kochab.server.http_server import Request, Response

PORT = 11111
DRIVER_FAULT = 0x500  # the first number that the standard leaves to drivers
METHOD, PROPERTY_GET, PROPERTY_PUT = 1, 2, 4  # of IDispatch
EXCEPTION, UNKNOWN_NAME, NO_MEMBER = 0x80020009, 0x80020006, 0x80020003
GONE = frozenset({0x800706BA, 0x800706BE, 0x80010108, 0x80010007})
"""What COM says of a driver whose own process has ended."""
Reader = Callable[[Mapping[str, str], str], Any]


def _utc(given: Mapping[str, str], name: str) -> datetime:
    try:
        moment = datetime.fromisoformat(given.get(name, "").strip().replace("Z", "+00:00"))
    except ValueError:
        raise BadRequest(f"{name} is not a date.") from None
    return moment if moment.tzinfo is None else moment.astimezone(UTC).replace(tzinfo=None)


PLACE: tuple[tuple[str, Reader], ...] = (("RightAscension", number_of), ("Declination", number_of))
READ = {
    name.lower(): name
    for name in (
        *("AlignmentMode", "Altitude", "AtHome", "AtPark", "Azimuth", "CanPulseGuide", "CanSetTracking", "CanSlew"),
        *("CanSlewAsync", "CanSync", "Connected", "Declination", "Description", "DriverInfo", "DriverVersion"),
        *("EquatorialSystem", "InterfaceVersion", "IsPulseGuiding", "Name", "RightAscension", "SideOfPier"),
        *("SiderealTime", "SiteElevation", "SiteLatitude", "SiteLongitude", "Slewing", "Tracking", "TrackingRate"),
        *("TrackingRates", "UTCDate"),
    )
}
"""Properties, by their names in the address."""
WRITTEN: Mapping[str, tuple[str, Reader]] = {
    "connected": ("Connected", truth),
    "tracking": ("Tracking", truth),
    "trackingrate": ("TrackingRate", whole),
    "sitelatitude": ("SiteLatitude", number_of),
    "sitelongitude": ("SiteLongitude", number_of),
    "siteelevation": ("SiteElevation", number_of),
    "utcdate": ("UTCDate", _utc),
}
"""Properties that can be set."""
CALLED: Mapping[str, tuple[str, tuple[tuple[str, Reader], ...]]] = {
    "abortslew": ("AbortSlew", ()),
    "pulseguide": ("PulseGuide", (("Direction", whole), ("Duration", whole))),
    "slewtocoordinatesasync": ("SlewToCoordinatesAsync", PLACE),
    "synctocoordinates": ("SyncToCoordinates", PLACE),
}
"""Methods with their arguments, in the order of COM."""


class Driver(Protocol):
    """A driver by the names of the standard; each raises `Fault`."""

    name: str

    def get(self, member: str) -> Any:
        """A property."""

    def put(self, member: str, value: Any) -> None:
        """Set a property."""

    def call(self, member: str, *values: Any) -> Any:
        """Call a method."""


class AscomBridge:
    """Answers for each of ``drivers`` as telescope 0, 1, ...; from any number of threads."""

    def __init__(self, drivers: Sequence[Driver]) -> None:
        self._drivers = drivers
        self._numbers = count(1)

    def answer(self, request: Request) -> Response:
        """The answer to any request."""
        if request.method not in METHODS:
            return WRONG_METHOD
        parts = request.path.strip("/").split("/")
        given = request.form if request.method == "PUT" else {k.lower(): v for k, v in request.query.items()}
        try:
            match parts:
                case ["management", *rest] if request.method == "GET":
                    return envelope(given, next(self._numbers), self._management(rest))
                case ["api", "v1", "telescope", device, name] if device in map(str, range(len(self._drivers))):
                    driver = self._drivers[int(device)]
                    value = None
                    try:
                        if request.method == "GET":
                            value = _get(driver, name, given)
                        else:
                            _put(driver, name, given)
                    except Fault as fault:
                        return envelope(given, next(self._numbers), None, fault)
                    return envelope(given, next(self._numbers), value)
        except BadRequest as error:
            return Response(f"{error}\n".encode(), "text/plain; charset=utf-8", HTTPStatus.BAD_REQUEST)
        return Response(b"There is no such device or method.\n", "text/plain", HTTPStatus.BAD_REQUEST)

    def close(self) -> None:
        """Let the drivers go."""
        for driver in self._drivers:
            try:
                driver.put("Connected", False)
            except Fault:
                continue

    def _management(self, rest: list[str]) -> Any:
        match rest:
            case ["apiversions"]:
                return [1]
            case ["v1", "description"]:
                who = {"ServerName": "Kochab's ASCOM bridge", "Manufacturer": "Kochab"}
                return {**who, "ManufacturerVersion": __version__, "Location": ""}
            case ["v1", "configureddevices"]:
                return [
                    {"DeviceName": one.name, "DeviceType": "Telescope", "DeviceNumber": n, "UniqueID": one.name}
                    for n, one in enumerate(self._drivers)
                ]
        raise BadRequest("No such management call.")


def _get(driver: Driver, name: str, given: Mapping[str, str]) -> Any:
    if name == "destinationsideofpier":
        values = [read(given, argument.lower()) for argument, read in PLACE]
        return driver.call("DestinationSideOfPier", *values)
    if name not in READ:
        raise Fault(NOT_IMPLEMENTED, f"{name} is not passed on.")
    value = driver.get(READ[name])
    if isinstance(value, datetime):
        return f"{value:%Y-%m-%dT%H:%M:%S.%f}"[:-3] + "Z"
    if value is None:
        raise Fault(VALUE_NOT_SET, f"{READ[name]} has no value.")
    return value


def _put(driver: Driver, name: str, given: Mapping[str, str]) -> None:
    if name in WRITTEN:
        member, read = WRITTEN[name]
        if member not in given:
            raise BadRequest(f"{member} is missing.")
        driver.put(member, read(given, member))
    elif name in CALLED:
        member, arguments = CALLED[name]
        driver.call(member, *(read(given, argument) for argument, read in arguments))
    else:
        raise Fault(NOT_IMPLEMENTED, f"{name} is not passed on.")


class ComDriver:
    """The COM object that Windows knows as ``name`` (a ProgID); PortError when it cannot be loaded.

    Calls come from threads without a window, the multithreaded apartment: Stop needs not wait for another call's end
    wherever the driver itself lets it through.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._object = self._load()

    def _load(self) -> Any:
        # Read by comtypes as it is imported: the multithreaded apartment.
        sys.coinit_flags = 0  # type: ignore[attr-defined]
        try:
            from comtypes import GUID, CoCreateInstance, COMError
            from comtypes.automation import IDispatch
        except ImportError:
            raise UsageError("ASCOM drivers need one more package: pip install 'kochab-astro[ascom]'.") from None
        self._failures = (OSError, COMError)
        try:
            kind = GUID.from_progid(self.name)
        except self._failures:
            raise PortError(
                "No ASCOM driver is called {name}; kochab serve --ascom lists those that are installed.", name=self.name
            ) from None
        try:
            return CoCreateInstance(kind, interface=IDispatch)
        except self._failures as error:
            raise PortError(
                "Windows can't load {name}: {why}. Is it a driver for 32 bits? ASCOM Remote serves it.",
                name=self.name,
                why=_reason(error),
            ) from None

    def get(self, member: str) -> Any:
        """The value of a property; a collection becomes a list."""
        value = self._invoke(PROPERTY_GET, member)
        if (rates := getattr(value, "_comobj", None)) is not None:
            (number,), (item,) = rates.GetIDsOfNames("Count"), rates.GetIDsOfNames("Item")
            last = int(rates.Invoke(number, _invkind=PROPERTY_GET))
            return [int(rates.Invoke(item, n, _invkind=METHOD | PROPERTY_GET)) for n in range(1, last + 1)]
        return value

    def put(self, member: str, value: Any) -> None:
        """Set a property; a driver whose process had ended is loaded again when it is to connect."""
        if member == "Connected" and value and self._object is None:
            try:
                self._object = self._load()
            except PortError as error:
                raise Fault(NOT_CONNECTED, str(error)) from None
        self._invoke(PROPERTY_PUT, member, value)

    def call(self, member: str, *values: Any) -> Any:
        """Call a method."""
        return self._invoke(METHOD, member, *values)

    def _invoke(self, kind: int, member: str, *values: Any) -> Any:
        driver = self._object
        if driver is None:
            raise Fault(NOT_CONNECTED, "The driver has ended.")
        try:
            (identifier,) = driver.GetIDsOfNames(member)
            return driver.Invoke(identifier, *values, _invkind=kind)
        except self._failures as error:
            fault = fault_of(getattr(error, "hresult", 0), getattr(error, "details", None), _reason(error))
            if fault.number == NOT_CONNECTED and (getattr(error, "hresult", 0) & 0xFFFFFFFF) in GONE:
                self._object = None
            raise fault from None


def _reason(error: Any) -> str:
    """What COM says of a failure."""
    text = getattr(error, "text", None) or getattr(error, "strerror", None) or str(error)
    return " ".join(str(text).split()).rstrip(".")


def fault_of(hresult: int, details: Sequence[Any] | None, text: str) -> Fault:
    """The ASCOM error that a failed call stands for.

    Parameters
    ----------
    hresult : int
        Of COM, signed or not.
    details : sequence or None
        Of a driver's exception: its description first, its own number last.
    text : str
        What to say where the driver says nothing.
    """
    number = hresult & 0xFFFFFFFF
    if number == EXCEPTION and details:
        number = int(details[-1] or 0) & 0xFFFFFFFF
        text = " ".join(str(details[0] or text).split())
    if number in (UNKNOWN_NAME, NO_MEMBER):
        return Fault(NOT_IMPLEMENTED, "The driver does not support it.")
    if number in GONE:
        return Fault(NOT_CONNECTED, "The driver has ended.")
    if 0x80040400 <= number <= 0x80040FFF:
        return Fault(number - 0x80040000, text)
    return Fault(DRIVER_FAULT, text or f"error {number:#010x}")


def installed() -> list[tuple[str, str]]:
    """ProgID and title of every telescope that the ASCOM Platform has in its register, of 64 and of 32 bits."""
    if sys.platform != "win32":
        return []
    import winreg

    found: dict[str, str] = {}
    for view in (winreg.KEY_WOW64_64KEY, winreg.KEY_WOW64_32KEY):
        try:
            key = winreg.OpenKey(
                winreg.HKEY_LOCAL_MACHINE, r"SOFTWARE\ASCOM\Telescope Drivers", access=winreg.KEY_READ | view
            )
        except OSError:
            continue
        with key:
            for n in range(winreg.QueryInfoKey(key)[0]):
                name = winreg.EnumKey(key, n)
                found.setdefault(name, winreg.QueryValue(key, name) or name)
    return sorted(found.items())
