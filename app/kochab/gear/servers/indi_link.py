"""A connection to an INDI server: the asyncio client of indipyclient in a thread of its own.

Everything that touches the client's tables runs in its loop; the calling thread waits, at most
for a limit, and is told when the line is lost.
"""

import asyncio
import logging
import re
import socket
from collections import defaultdict, deque
from collections.abc import Callable, Coroutine
from importlib.util import find_spec
from threading import Condition, Thread
from time import monotonic
from typing import Any, TypeVar

from kochab.core.errors import LineLostError, NoAnswerError, PortError, RefusedError
from kochab.gear.servers.address import WORDS, NetAddress, server_text, unreachable
from kochab.text.translation import tr, tr_noop

T = TypeVar("T")
CONNECT_S = 5.0
CALL_S = 4.5
LARGEST_BYTES = 1_600_000_000  # of a picture's message, in which three bytes are written as four
VECTOR_BYTES, MOST_VECTORS = 4_000_000, 20_000  # of any other message; of all that a server may define
PORT = 7624
TELL_S = 5.0  # how long a server may take to tell what it has
MORE_S = 0.5  # how long after its first device it may take to tell of another
POWER_UP_S = 20.0  # how long a device may take to connect to its driver
SET_S = 5.0
DISCONNECTED = tr_noop("The INDI server {server} disconnected. Check its computer.")
TELESCOPE_INTERFACE, CCD_INTERFACE = 1 << 0, 1 << 1  # INDI's DriverInterface bits


def missing() -> str | None:
    """How to get the client library, which is an extra; None when it is there."""
    return None if find_spec("indipyclient") else tr("INDI needs one more package: pip install 'kochab-astro[indi]'.")


class IndiLink:
    """One server, watched from the calling thread. Raises `PortError` when there is no server at the address."""

    def __init__(self, address: NetAddress) -> None:
        if absent := missing():
            raise PortError(absent)
        _knock(address)
        self._address = address
        self._news = Condition()
        self._blob: tuple[bytes, str] | None = None
        self._wanted = ""
        self._heard: dict[tuple[str, str], deque[tuple[float, str]]] = defaultdict(lambda: deque(maxlen=50))
        self._spoke_s: dict[str, float] = {}  # when a device last told anything, on `monotonic`
        self.defined_s = 0.0  # when the server last told of something new, on `monotonic`
        self._defined: set[tuple[str, str]] = set()
        self._lost: str | None = None
        self._made = False
        self.message = ""
        self.last_word = ""
        """What the server told last, of whatever kind."""
        self._loop = asyncio.new_event_loop()
        self._client: Any = None
        self._thread = Thread(target=self._run, name="kochab-indi", daemon=True)
        self._thread.start()
        if not self.wait(lambda: self._made, CONNECT_S):
            self.close()
            raise PortError("{server} does not answer as an INDI server.", server=address.server)

    def devices(self, interface: int) -> list[str]:
        """Names of the devices of a kind, as far as the server has told."""
        return self.ask(lambda client: [n for n, d in client.items() if _is_of(d, interface)])

    def named(self, interface: int, wanted: str = "") -> list[str]:
        """The same when all are told: they come one after another, and nobody says which is the last."""
        if self.wait(lambda: bool(self.devices(interface)), TELL_S):
            self.wait(lambda: wanted in self.devices(interface), MORE_S)
        return self.devices(interface)

    def value(self, device: str, vector: str, member: str) -> str | None:
        """A member's value, None when there is no such thing (any more)."""
        return self.ask(lambda client: _member(client, device, vector, member))

    def number(self, device: str, vector: str, member: str) -> float | None:
        """The same of a number, however the server writes it."""

        def read(client: Any) -> float | None:
            if _member(client, device, vector, member) is None:
                return None
            return float(client[device][vector].member(member).getfloatvalue())

        return self.ask(read)

    def members(self, device: str, vector: str) -> list[str]:
        """The names of a vector's members, in the device's order; empty when there is no such vector."""
        return self.ask(lambda client: list(client.get(device, {}).get(vector) or ()))

    def heard_since(self, device: str, vector: str, since_s: float) -> list[tuple[float, str]]:
        """When the device has told of the vector since (both on `monotonic`), and its states then."""
        with self._news:
            return [one for one in self._heard[device, vector] if one[0] > since_s]

    def spoke_s(self, device: str) -> float:
        """When the device last told anything, on `monotonic`."""
        with self._news:
            return self._spoke_s.get(device, 0.0)

    def bounds(self, device: str, vector: str, member: str) -> tuple[float, float] | None:
        """The least and the most a number may be."""

        def read(client: Any) -> tuple[float, float] | None:
            if _member(client, device, vector, member) is None:
                return None
            found = client[device][vector].member(member)
            least, most = float(found.getfloat(found.min)), float(found.getfloat(found.max))
            return (least, most) if most > least else None

        return self.ask(read)

    def state(self, device: str, vector: str) -> str | None:
        """``Idle``, ``Ok``, ``Busy`` or ``Alert``; None when there is no such vector."""

        def read(client: Any) -> str | None:
            found = client.get(device, {}).get(vector)
            # A deleted vector stays in the client's table with enable off.
            return str(found.state) if found is not None and found.enable else None

        return self.ask(read)

    def send(self, device: str, vector: str, members: dict[str, str]) -> None:
        """Ask the device to take new values; it answers when it likes."""
        self._call(lambda: self._client.send_newVector(device, vector, members=members))

    def want_blobs(self, device: str, vector: str) -> None:
        """Have the pictures of one camera sent here, and nobody else's."""
        self._wanted = f"{device}\n{vector}"
        self._call(lambda: self._client.send_enableBLOB("Also", device, vector))

    def take_blob(self, timeout_s: float) -> tuple[bytes, str] | None:
        """The newest picture's bytes and suffix, None when none came in time."""
        if not self.wait(lambda: self._blob is not None, timeout_s):
            return None
        with self._news:
            blob, self._blob = self._blob, None
        return blob

    def wait(self, come: Callable[[], bool], timeout_s: float) -> bool:
        """Whether ``come`` became true in time; it is asked after every piece of news.

        Raises `LineLostError` when the server went away.
        """
        deadline = monotonic() + timeout_s
        while True:
            self.check()
            if come():
                return True
            left = deadline - monotonic()
            if left <= 0:
                return False
            with self._news:
                # At most 50 ms: news between the question and this wait would be missed otherwise.
                self._news.wait(min(left, 0.05))

    def check(self) -> None:
        """Raise LineLostError when the server has gone."""
        if self._lost is not None:
            raise LineLostError(self._lost)

    def ask(self, read: Callable[[Any], T]) -> T:
        """What ``read`` finds in the client's tables, read in the client's own thread."""

        async def reading() -> T:
            return read(self._client)

        return self._call(reading)

    def close(self) -> None:
        """Leave the server; never raises."""
        self._lost = self._lost or tr("The connection was closed.")
        if self._client is not None:
            self._client.shutdown()
        self._thread.join(CALL_S)

    def _call(self, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
        self.check()
        doing = work()
        try:
            return asyncio.run_coroutine_threadsafe(doing, self._loop).result(CALL_S)
        except TimeoutError:
            self.check()
            raise NoAnswerError("The INDI server {server} stopped answering.", server=self._address.server) from None
        except RuntimeError:  # the loop has ended meanwhile
            doing.close()
            self.check()
            raise

    def _run(self) -> None:
        from indipyclient import IPyClient

        log = logging.getLogger("indipyclient")
        log.addHandler(logging.NullHandler())
        log.propagate = False  # what it says there reaches the person through our own sentences
        link = self

        class Client(IPyClient):  # type: ignore[misc]
            _reader: Any

            async def rxevent(self, event: Any) -> None:
                if isinstance(self._reader, _Measured):
                    self._reader.unheard_bytes = 0
                link._hear(event)

            async def hardware(self) -> None:
                # The client takes the end of the stream for silence and would wait for ever.
                while not self._stop:
                    if self._reader is not None and not isinstance(self._reader, _Measured):
                        self._reader = _Measured(self._reader, lambda: bool(link._wanted))
                    if self._reader is not None and self._reader.at_eof():
                        if isinstance(self._reader, _Measured) and self._reader.endless:
                            link._endless()
                        link._lose()
                        self.shutdown()
                    await asyncio.sleep(0.05)

        asyncio.set_event_loop(self._loop)
        self._client = Client(indihost=self._address.host.strip("[]"), indiport=self._address.port)
        try:
            self._loop.run_until_complete(self._client.asyncrun())
        finally:
            self._lose()
            self._loop.close()

    def _lose(self) -> None:
        with self._news:
            self._lost = self._lost or tr(DISCONNECTED, server=self._address.server)
            self._news.notify_all()

    def _endless(self) -> None:
        """Disconnect from a server that never stops defining or sending."""
        self._lost = self._lost or tr("{server} never ends its reply.", server=self._address.server)
        self._client.shutdown()

    def _hear(self, event: Any) -> None:
        kind = event.eventtype
        if kind == "ConnectionLost":
            self._lose()
        with self._news:
            self._made = self._made or kind == "ConnectionMade"
            if device := getattr(event, "devicename", None):
                self._spoke_s[device] = monotonic()
            if kind == "Define":
                self.defined_s = monotonic()
                self._defined.add((event.devicename, event.vectorname))
                if len(self._defined) > MOST_VECTORS:
                    self._endless()
            elif kind == "Set":
                self._heard[event.devicename, event.vectorname].append((monotonic(), str(event.state or "")))
            if kind == "SetBLOB" and f"{event.devicename}\n{event.vectorname}" == self._wanted:
                for name, data in event.items():
                    if data:
                        self._blob = bytes(data), str(event.sizeformat[name][1])
            elif kind == "Message":
                words = re.sub(r"\[[A-Z]+\]", "", str(event.message)[:WORDS])
                self.last_word = server_text(" ".join(words.split()), WORDS)
                if "[ERROR]" in str(event.message):
                    self.message = self.last_word
            self._news.notify_all()


class _Measured:
    """A stream that ends when what it brings never becomes a whole message."""

    def __init__(self, stream: Any, pictures: Callable[[], bool]) -> None:
        self._stream, self._pictures = stream, pictures
        self.unheard_bytes = 0

    @property
    def endless(self) -> bool:
        """Whether it is longer than any message is, or any picture where one is wanted."""
        return self.unheard_bytes > (LARGEST_BYTES if self._pictures() else VECTOR_BYTES)

    async def read(self, most: int) -> bytes:
        """The next piece."""
        data: bytes = await self._stream.read(most)
        self.unheard_bytes += len(data)
        return data

    def at_eof(self) -> bool:
        """Whether nothing more comes, or nothing that can be used."""
        return bool(self._stream.at_eof()) or self.endless


def _knock(address: NetAddress) -> None:
    """See that somebody listens, so that the reason is known when not."""
    try:
        socket.create_connection((address.host.strip("[]"), address.port), CONNECT_S).close()
    except OSError as error:
        raise unreachable(address, "INDI", error, "indiserver") from None


def _is_of(device: Any, interface: int) -> bool:
    info = device.get("DRIVER_INFO")
    interfaces = info.get("DRIVER_INTERFACE", "") if info is not None and device.enable else ""
    if server_text(str(device.devicename)) != device.devicename:  # INDI's names have 64 letters that are seen
        return False
    return str(interfaces).strip().isdigit() and bool(int(interfaces) & interface)


def _member(client: Any, device: str, vector: str, member: str) -> str | None:
    found = client.get(device, {}).get(vector)
    if found is None or not found.enable or member not in found:
        return None
    return str(found[member])


class IndiDevice:
    """One device of a server, by the names of INDI's standard properties."""

    def __init__(self, link: IndiLink, name: str) -> None:
        self.link, self.name = link, name

    def value(self, vector: str, member: str) -> str | None:
        """A member's value, None when there is no such thing."""
        return self.link.value(self.name, vector, member)

    def number(self, vector: str, member: str) -> float | None:
        """The same of a number."""
        return self.link.number(self.name, vector, member)

    def state(self, vector: str) -> str | None:
        """``Idle``, ``Ok``, ``Busy`` or ``Alert``; None when there is no such vector."""
        return self.link.state(self.name, vector)

    def power_up(self, *vectors: str) -> bool:
        """Connect the device to its driver, until it has these vectors; whether it had to be connected."""
        off = self.value("CONNECTION", "CONNECT") != "On"
        if off:
            self.send("CONNECTION", {"CONNECT": "On"})

        def ready() -> bool:
            connected = self.value("CONNECTION", "CONNECT") == "On" and self.state("CONNECTION") != "Busy"
            return connected and None not in map(self.state, vectors)

        if not self.link.wait(ready, POWER_UP_S):
            raise PortError(
                "Can't connect {name}{message}. Check its cable and power.", name=self.name, message=self.message()
            )
        return off

    def check(self) -> None:
        """Raise LineLostError when the server has gone, or the device is no longer connected."""
        self.link.check()
        connected = self.value("CONNECTION", "CONNECT")
        if connected != "On":
            why = tr("its driver stopped") if connected is None else tr("it was disconnected")
            raise LineLostError("Lost {name} on the INDI server: {why}.", name=self.name, why=why)

    def send(self, vector: str, members: dict[str, str]) -> float:
        """Ask the device to take new values; when that was, on `monotonic`."""
        self.link.message = self.link.last_word = ""
        sent_s = monotonic()
        self.link.send(self.name, vector, members)
        return sent_s

    def set(self, vector: str, members: dict[str, str], what: str) -> None:
        """Set ``members``; RefusedError when the driver does not take them."""
        self.send(vector, members)

        def done() -> bool:
            same = (_same(self.value(vector, member), meant) for member, meant in members.items())
            return self.state(vector) != "Busy" and all(same)

        if not self.link.wait(done, SET_S):
            raise RefusedError(
                "{name} does not accept this {what}{message}.", name=self.name, what=tr(what), message=self.message()
            )

    def message(self, any_kind: bool = False) -> str:
        """What the server last told as an error, in brackets; of ``any_kind`` where it told no error."""
        words = self.link.message or (self.link.last_word if any_kind else "")
        return f" ({words.rstrip('.')})" if words else ""


def _same(reported: str | None, meant: str) -> bool:
    try:
        # Servers write numbers in formats of their own, with few digits.
        return reported is not None and abs(float(reported) - float(meant)) < 1e-6 + 1e-4 * abs(float(meant))
    except ValueError:
        return reported == meant
