"""The serial ports of this computer, and the mount on each, found by questions only.

No byte that moves anything is sent, nor one that could begin such a command on a device of another
make: NexStar is asked first because the commands of other makes contain its one-letter commands
(``R`` in ``:GR#`` begins a goto there).
"""

import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from time import monotonic
from typing import Any, TypeVar

from kochab.core.errors import DeviceError, NoAnswerError, PortError
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.gear.mounts import DRIVERS, SERVERS, Diagnosis
from kochab.gear.mounts.drivers.lx200_dialects import DIALECTS, named
from kochab.gear.mounts.drivers.nexstar import MAKER_SINCE, STARSENSE, VARIANTS
from kochab.gear.mounts.protocols import ioptron, lx200, nexstar, skywatcher
from kochab.gear.mounts.serial_line import QUIET_S, UDP, Conversation, Reader, SerialLink, exactly, until
from kochab.text.translation import tr, tr_noop

PROBE_S = 20.0  # for all questions on one port
PATIENCE_S = 0.8  # an Autostar took 0.63 s to answer after its port was opened
NO_SITE = tr_noop("It stores no site: give --site LAT,LON.")
T = TypeVar("T")
SWITCH_ON = tr_noop("Switch the mount on and check its cable. Use the computer port, not the guide port.")


class Probing(Conversation):
    """A conversation that is over at ``end_s`` (`monotonic`): a line that trickles answers every question late."""

    def __init__(self, link: SerialLink, end_s: float) -> None:
        super().__init__(link)
        self._end_s = end_s

    def ask(self, command: bytes, read: Reader, parse: Callable[[bytes], T], since: int | None = None) -> T:
        """One question more, if there is time for it.

        Parameters
        ----------
        command : bytes
            The bytes to send.
        read : Reader
            Takes the answer from the line.
        parse : Callable[[bytes], T]
            Reads the answer.
        since : int or None
            As in :meth:`Conversation.ask`.
        """
        if monotonic() > self._end_s:
            raise NoAnswerError("No mount answered on {port} in time.", port=self.link.port)
        return super().ask(command, read, parse, since)


def ask_nexstar(talk: Conversation) -> Diagnosis:
    """Echo, version, alignment."""
    echo = b"K\x40"
    talk.ask(echo, exactly(2, PATIENCE_S), lambda reply: nexstar.parse_echo(reply, echo[1:]))
    version = talk.ask(nexstar.VERSION, nexstar.read_version(PATIENCE_S), nexstar.parse_version)
    # SynScan answers with six hexadecimal digits, NexStar with two bytes.
    driver, maker = ("synscan", "SynScan") if len(version) == 3 else ("nexstar", "NexStar")
    if maker == "NexStar" and not (2, 2) <= version < MAKER_SINCE:
        with suppress(NoAnswerError):
            if VARIANTS.get(talk.ask(nexstar.VARIANT, exactly(2, PATIENCE_S), nexstar.parse_byte)) is STARSENSE:
                driver, maker = "starsense", "StarSense"
    aligned = talk.ask(nexstar.ALIGNED, exactly(2, PATIENCE_S), nexstar.parse_flag)
    advice = "" if aligned else tr("It is not aligned: do its alignment on the hand control first.")
    name = tr("{maker} hand control, version {version}", maker=maker, version=".".join(map(str, version)))
    return Diagnosis(driver=driver, name=name, advice=advice)


def ask_skywatcher(talk: Conversation) -> Diagnosis:
    """Version and position of the first motor."""
    reader = skywatcher.reader(PATIENCE_S)
    version = talk.ask(skywatcher.command("e", 0), reader, skywatcher.parse_data)
    talk.ask(skywatcher.command("j", 0), reader, skywatcher.parse_position)
    if talk.link.discard(QUIET_S):  # a board speaks when it is asked
        raise NoAnswerError("The device on {port} sends without being asked.", port=talk.link.port)
    name = tr("Sky-Watcher motor board, version {version}", version=version[:4])
    return Diagnosis(driver="skywatcher", name=name, advice=tr(NO_SITE))


def ask_lx200(talk: Conversation) -> Diagnosis:
    """Declination first, for ``:GR#`` is not sent to an unknown device; then the names it may have."""
    reader = until(b"#", 40, PATIENCE_S)
    talk.send(b"#")  # ends a question of another make
    echo = talk.ask(lx200.GET_DEC, reader, lx200.parse_echoed)
    if not echo:
        talk.ask(lx200.GET_RA, reader, lx200.parse_ra)
    product = ""
    # Astro-Physics and Rainbow do not answer :GVP#.
    for who in (lx200.PRODUCT, DIALECTS["astrophysics"].who) if not echo else (DIALECTS["rainbow"].who,):
        with suppress(NoAnswerError):
            product = talk.ask(who, reader, lx200.parse_text)
            break
    driver = named(product)
    name = product if driver not in ("astrophysics", "rainbow") else f"{DIALECTS[driver].title} {product.strip(':AV')}"
    return Diagnosis(driver=driver or "lx200", name=name or tr("LX200 classic or compatible"))


def ask_ioptron(talk: Conversation) -> Diagnosis:
    """Model and position."""
    talk.send(b"#")
    model = talk.ask(ioptron.MOUNT_INFO, exactly(4, PATIENCE_S), ioptron.parse_model)
    talk.ask(ioptron.POSITION, until(b"#", 24, PATIENCE_S), ioptron.parse_position)
    return Diagnosis(driver="ioptron", name=f"iOptron {model}")


def ask_celestron_aux(talk: Conversation) -> Diagnosis:
    """Version and model of the RA or azimuth motor, as the maker's app asks."""
    asked = [nexstar.aux(nexstar.AZM, command) for command in (nexstar.AUX_VERSION, nexstar.AUX_MODEL)]
    talk.ask(asked[0], nexstar.aux_reader(asked[0], PATIENCE_S), lambda reply: nexstar.parse_aux(reply, 2, 4))
    name = tr("motor board")
    with suppress(NoAnswerError):
        model = talk.ask(asked[1], nexstar.aux_reader(asked[1], PATIENCE_S), lambda reply: nexstar.parse_aux(reply, 2))
        name = nexstar.MODELS.get(model[0], name)
    return Diagnosis(driver="celestronaux", name=tr("Celestron {model} (AUX bus)", model=name), advice=tr(NO_SITE))


Question = Callable[[Conversation], Diagnosis]
QUESTIONS: tuple[tuple[int, tuple[Question, ...]], ...] = (
    (9600, (ask_nexstar, ask_skywatcher, ask_lx200, ask_celestron_aux)),
    (115200, (ask_skywatcher, ask_lx200, ask_ioptron)),
    (230400, (ask_ioptron,)),
)
"""Baud rate -> the questions there, in this order."""

ALL = (ask_nexstar, ask_skywatcher, ask_lx200, ask_ioptron, ask_celestron_aux)


def probe(ports: Iterable[str], opener: Callable[[str, int], SerialLink] = SerialLink) -> Task[list[Diagnosis]]:
    """Look at every port; a cancel point before each question."""
    diagnoses: dict[str, Diagnosis] = {}
    for port in ports:
        diagnoses[port] = yield from probe_port(port, opener)
    return list(diagnoses.values())


def probe_port(port: str, opener: Callable[[str, int], SerialLink] = SerialLink) -> Task[Diagnosis]:
    """What is on one port, or the exact thing to do."""
    if SERVED.fullmatch(port):
        return (yield from _ask_servers(port))
    network = "://" in port
    # A network has no baud rate, and over UDP only Sky-Watcher's Wi-Fi answers.
    end_s = monotonic() + PROBE_S
    rounds = ((0, (ask_skywatcher,) if port.startswith(UDP) else ALL),) if network else QUESTIONS
    for baud, questions in rounds:
        try:
            link = opener(port, baud or 9600)
        except PortError as error:
            return Diagnosis(port, advice=str(error))
        try:
            found = yield from _round(port, baud, questions, Probing(link, end_s))
        except DeviceError as error:  # the line broke
            return Diagnosis(port, advice=str(error))
        finally:
            link.close()
        if found is not None:
            return replace(found, port=port, baud=baud)
    bauds = ", ".join(str(baud) for baud, _ in QUESTIONS)
    tried = tr("No mount answers on {port}.") if network else tr("No mount answers on {port} at {bauds} baud.")
    return Diagnosis(port, advice=f"{tried.format(port=port, bauds=bauds)} {tr(SWITCH_ON)}")


def _round(port: str, baud: int, questions: tuple[Question, ...], talk: Conversation) -> Task[Diagnosis | None]:
    for ask in questions:
        make = ask.__name__.removeprefix("ask_")
        text = tr("{port} for {make} at {baud} baud") if baud else tr("{port} for {make}")
        yield Progress("asking", None, text.format(port=port, make=make, baud=baud))
        with suppress(NoAnswerError):
            return ask(talk)
    return None


# -- Servers of mounts: INDI on this computer, and what answers on the network ----------------

SERVED = re.compile(r"(\[[^]]+\]|[^/:\[]+)(:\d+(/.*)?|/.+)")
"""An address such as ``localhost:7624/EQMod Mount``."""


def find_served(address: str = "") -> list[Diagnosis]:
    """The mounts behind the servers at an address, or behind those that need none."""
    found: list[Diagnosis] = []
    for driver in SERVERS:
        with suppress(DeviceError):
            found += DRIVERS.load(driver).found(address)
    return found


def _ask_servers(port: str) -> Task[Diagnosis]:
    yield Progress("asking", None, tr("{port} for its mounts", port=port))
    there = find_served(port)
    named = [one for one in there if one.port == port or "/" not in port]
    if len(named) == 1:
        return named[0]
    if not there:
        return Diagnosis(port, advice=tr("No mount answers at {port}. Start its server there.", port=port))
    choice = ", ".join(one.port for one in there)
    return Diagnosis(port, advice=tr("No mount answers at {port}: choose one of {choice}.", port=port, choice=choice))


# -- The serial ports of this computer, with a hint from their USB adapter ---------------------

ADAPTERS = {
    0x0403: tr_noop("FTDI adapter (EQDIR cables, iOptron)"),
    0x067B: tr_noop("Prolific adapter (Celestron and SynScan hand controls)"),
    0x1A86: tr_noop("CH340 adapter (OnStep boards, newer Sky-Watcher mounts)"),
    0x10C4: tr_noop("Silicon Labs adapter (OnStep on an ESP32, iOptron)"),
    0x2341: "Arduino",
    0x16C0: tr_noop("Teensy (OnStep)"),
    0x0483: tr_noop("STMicroelectronics (mounts with their own USB)"),
    0x04D8: tr_noop("Microchip (mounts with their own USB)"),
}
"""USB vendor -> the adapter, and where it is often met; many makes share one."""

MAKERS = ("celestron", "sky-watcher", "skywatcher", "ioptron", "onstep", "meade", "10micron")


@frozen
class PortInfo:
    """One port; ``hint`` names what it might be, empty when nothing is known."""

    port: str
    description: str
    usb: str = ""
    hint: str = ""


def list_ports() -> list[PortInfo]:
    """Ports that have a device behind them, those on USB first.

    Raises PortError when the system does not list them: pyserial finds a part of the system missing or is refused.
    """
    try:
        from serial.tools import list_ports as tools

        listed = list(tools.comports())
    except (OSError, ImportError, AttributeError) as error:  # ctypes tells of a missing function as an attribute
        raise PortError(
            "The serial ports cannot be listed ({error}). Give the port by name, such as COM3.", error=error
        ) from None
    found = [port_info(p) for p in listed if p.vid is not None or p.hwid not in ("", "n/a")]
    return sorted(found, key=lambda p: (not p.usb, p.port))


def port_info(port: Any) -> PortInfo:
    """Description and hint for a port by its USB descriptors (pyserial's ``ListPortInfo``)."""
    usb_name = " ".join(dict.fromkeys(word for word in (port.manufacturer, port.product) if word))
    text = usb_name or (port.description if port.description not in (None, "n/a") else "") or tr("serial port")
    usb = "" if port.vid is None else f"{port.vid:04x}:{port.pid or 0:04x}"
    maker = next((m for m in MAKERS if m in f"{text} {port.description}".lower()), None)
    hint = tr("a mount by {maker}", maker=maker) if maker else tr(ADAPTERS.get(port.vid or 0, ""))
    return PortInfo(port.device, text, usb, hint)
