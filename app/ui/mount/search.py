"""Finding ports and mounts, as tasks for a job of their own; questions only, nothing moves."""

from app.core.progress import Progress, Task
from app.mounts.ports import PortInfo
from app.mounts.probe import Diagnosis

NO_PORTS = (
    "There is no serial port: plug in the USB cable of the mount and switch it on. A mount on the "
    "network is typed as socket://HOST:PORT."
)


def ports() -> Task[list[PortInfo]]:
    """The serial ports with what USB tells of them."""
    yield Progress("looking for ports")
    from app.mounts.ports import list_ports

    return list_ports()


def find(typed: str) -> Task[tuple[list[PortInfo], list[Diagnosis]]]:
    """Ask on every port, first on the one that was typed, which mount is there."""
    from app.mounts.probe import probe_port

    listed = yield from ports()
    names = [typed] if typed else []
    names += [info.port for info in listed if info.port != typed]
    found = []
    for name in names:
        diagnosis = yield from probe_port(name)
        found.append(diagnosis)
        if diagnosis.found:
            break
    return listed, found


def words(found: list[Diagnosis]) -> str:
    """What came of it, with the exact fix where nothing answers."""
    if not found:
        return NO_PORTS
    told = []
    for one in found:
        name = f"{one.name} on {one.port}" + (f" at {one.baud} baud" if one.baud else "")
        told.append(". ".join(w for w in (name if one.found else "", one.advice) if w))
    return "\n".join(told)
