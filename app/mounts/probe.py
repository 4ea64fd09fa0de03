"""The serial doctor: which mount is on which port, by questions only.

No byte that moves anything is sent, nor one that could begin such a command on a device of another
make: NexStar is asked first because its one-letter commands lurk in the words of others (``R`` in
``:GR#`` begins a goto there).
"""

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass

from app.core.errors import DeviceError, NoAnswerError, PortError
from app.core.progress import Progress, Task
from app.mounts.conversation import Conversation, exactly, until
from app.mounts.link import Link, open_link
from app.mounts.protocols import ioptron, lx200, nexstar, skywatcher

PATIENCE_S = 0.8


@dataclass(frozen=True, slots=True)
class Found:
    """A mount that answered."""

    driver: str
    name: str
    note: str = ""


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """What was learnt of one port: a mount, or what to do."""

    port: str
    driver: str = ""
    baud: int = 0
    name: str = ""
    advice: str = ""

    @property
    def found(self) -> bool:
        """Whether a mount answered."""
        return bool(self.driver)


def ask_nexstar(talk: Conversation) -> Found:
    """Echo, version, alignment."""
    echo = b"K\x40"
    talk.ask(echo, exactly(2, PATIENCE_S), lambda reply: nexstar.parse_echo(reply, echo[1:]))
    version = talk.ask(nexstar.VERSION, _version, nexstar.parse_version)
    driver, maker = ("synscan", "SynScan") if len(version) == 3 else ("nexstar", "NexStar")
    aligned = talk.ask(nexstar.ALIGNED, exactly(2, PATIENCE_S), nexstar.parse_flag)
    note = "" if aligned else "It is not aligned: do its alignment on the hand control first."
    told = ".".join(str(part) for part in version)
    return Found(driver, f"{maker} hand control, version {told}", note)


def ask_skywatcher(talk: Conversation) -> Found:
    """Version and position of the first motor."""
    reader = until(b"\r", 16, PATIENCE_S)
    version = talk.ask(skywatcher.command("e", 0), reader, skywatcher.parse_data)
    talk.ask(skywatcher.command("j", 0), reader, skywatcher.parse_position)
    return Found(
        "skywatcher",
        f"Sky-Watcher motor board, version {version[:4]}",
        "It does not know its site: give --site LAT,LON.",
    )


def ask_lx200(talk: Conversation) -> Found:
    """Declination first, for ``:GR#`` is not sent to a stranger; then the product's name."""
    talk.tell(b"#")  # ends what a question of another make has left half-written
    talk.ask(lx200.GET_DEC, until(b"#", 16, PATIENCE_S), lx200.parse_dec)
    talk.ask(lx200.GET_RA, until(b"#", 16, PATIENCE_S), lx200.parse_ra)
    product = ""
    with suppress(NoAnswerError):
        product = talk.ask(lx200.PRODUCT, until(b"#", 40, PATIENCE_S), lx200.parse_text)
    if "onstep" in product.lower().replace("-", ""):
        return Found("onstep", product)
    return Found("lx200", product or "LX200 classic or compatible")


def ask_ioptron(talk: Conversation) -> Found:
    """Model and position."""
    talk.tell(b"#")
    model = talk.ask(ioptron.MOUNT_INFO, exactly(4, PATIENCE_S), ioptron.parse_model)
    talk.ask(ioptron.POSITION, until(b"#", 24, PATIENCE_S), ioptron.parse_position)
    return Found("ioptron", f"iOptron {model}")


def _version(link: Link) -> bytes:
    reply = link.read_exact(3, PATIENCE_S)
    return reply if reply[2:] == b"#" else reply + link.read_exact(4, PATIENCE_S)


Asking = Callable[[Conversation], Found]
ASKINGS: tuple[tuple[int, tuple[Asking, ...]], ...] = (
    (9600, (ask_nexstar, ask_skywatcher, ask_lx200)),
    (115200, (ask_skywatcher, ask_lx200, ask_ioptron)),
    (230400, (ask_ioptron,)),
)
"""Baud rate -> what is asked there, in this order."""

ALL: tuple[Asking, ...] = (ask_nexstar, ask_skywatcher, ask_lx200, ask_ioptron)


def probe(
    ports: Iterable[str], opener: Callable[[str, int], Link] = open_link
) -> Task[list[Diagnosis]]:
    """Look at every port; a cancel point before each question."""
    diagnoses: dict[str, Diagnosis] = {}
    for port in ports:
        diagnoses[port] = yield from probe_port(port, opener)
    return list(diagnoses.values())


def probe_port(port: str, opener: Callable[[str, int], Link] = open_link) -> Task[Diagnosis]:
    """What is on one port, or the exact thing to do."""
    network = "://" in port
    rounds = ((0, ALL),) if network else ASKINGS
    for baud, askings in rounds:
        try:
            link = opener(port, baud or 9600)
        except PortError as error:
            return Diagnosis(port, advice=str(error))
        try:
            found = yield from _round(port, baud, askings, Conversation(link))
        except DeviceError as error:  # the line broke
            return Diagnosis(port, advice=str(error))
        finally:
            link.close()
        if found is not None:
            return Diagnosis(port, found.driver, baud, found.name, found.note)
    tried = "" if network else f" at {', '.join(str(baud) for baud, _ in ASKINGS)} baud"
    return Diagnosis(
        port,
        advice=f"No mount answers on {port}{tried}: switch the mount on, check its cable and that "
        "it is plugged into the socket for a computer, not the one for a guider.",
    )


def _round(
    port: str, baud: int, askings: tuple[Asking, ...], talk: Conversation
) -> Task[Found | None]:
    for ask in askings:
        make = ask.__name__.removeprefix("ask_")
        yield Progress("asking", None, f"{port} for {make}" + (f" at {baud} baud" if baud else ""))
        with suppress(NoAnswerError):
            return ask(talk)
    return None
