"""The telescope offered at its ports, in every protocol that is asked for."""

from collections.abc import Mapping
from pkgutil import resolve_name

from kochab.core.errors import PortError, UsageError
from kochab.core.values import frozen
from kochab.server.http_server import LOOPBACK
from kochab.server.phone_page import local_address
from kochab.server.telescope.listening import Ports
from kochab.server.telescope.stellarium_remote import StellariumRemote, remote_address
from kochab.workflows.telescope.offered import OfferedTelescope


@frozen
class Row:
    """One protocol: its name on the screen, what listens for it ("module:name"), and its usual port."""

    title: str
    listen: str
    port: int


PROTOCOLS: Mapping[str, Row] = {
    "lx200": Row("LX200", "kochab.server.telescope.lx200:listen", 4030),
    "stellarium": Row("Stellarium", "kochab.server.telescope.stellarium:listen", 10001),
    "alpaca": Row("Alpaca", "kochab.server.telescope.alpaca:listen", 11111),
    "indi": Row("INDI", "kochab.server.telescope.indi:listen", 7624),
}


class Offer:
    """Listens until :meth:`stop`; ``ports`` are those it has, by protocol.

    Raises `UsageError` when there is no such protocol, and `PortError` when a port that was asked for, or every usual
    one, cannot be had.

    Parameters
    ----------
    telescope : OfferedTelescope
        What is offered.
    wanted : Mapping[str, int or None]
        Protocols, each with its port, None for the usual one; empty for all of them.
    lan : bool
        Whether the local network may come too, unencrypted.
    stellarium_remote : str or None
        Where Stellarium's Remote Control is asked, see :func:`remote_address`; None to leave it alone.
    """

    def __init__(
        self,
        telescope: OfferedTelescope,
        wanted: Mapping[str, int | None],
        lan: bool = False,
        stellarium_remote: str | None = None,
    ) -> None:
        for name in wanted:
            if name not in PROTOCOLS:
                raise UsageError("There is no protocol “{name}”: {all}.", name=name, all=", ".join(PROTOCOLS))
        remote = None if stellarium_remote is None else remote_address(stellarium_remote)
        self.host = local_address() if lan else LOOPBACK[0]
        self.ports: dict[str, int] = {}
        self._listening = Ports(telescope, self.host)
        taken: list[PortError] = []
        try:
            for name, port in (wanted or dict.fromkeys(PROTOCOLS)).items():
                row = PROTOCOLS[name]
                try:
                    at = row.port if port is None else port
                    self.ports[name] = resolve_name(row.listen)(self._listening, at)
                except PortError as error:
                    if wanted:
                        raise
                    taken.append(error)  # an indiserver of this computer has its own port: the others are offered
                    telescope.say(f"{row.title}: {error}")
            if not self.ports:
                raise taken[0]
            if remote is not None:
                self._listening.others.append(StellariumRemote(telescope, remote))
        except BaseException:
            self.stop()
            raise

    @property
    def lines(self) -> list[str]:
        """Where programs find it, a line a protocol."""
        return [f"{PROTOCOLS[name].title}: {self.host}:{port}" for name, port in self.ports.items()]

    def stop(self) -> None:
        """Close every port."""
        self._listening.stop()
