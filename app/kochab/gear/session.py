"""The mount and the camera of one evening, for the window and the command line: chosen, found, opened."""

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from kochab.core.capture import CameraSource, CaptureSettings
from kochab.core.errors import NoAnswerError, PortError, UsageError
from kochab.core.frame import Site
from kochab.core.mount import Epoch, Home
from kochab.core.progress import Progress, Task
from kochab.core.values import frozen
from kochab.folders import config_folder, state_folder
from kochab.frames.atomic_file import write_atomically
from kochab.gear.journal import utc_now
from kochab.gear.mount_events import MountEvent, PracticeStarted
from kochab.gear.mounts import DRIVERS, SERVERS, Diagnosis, MountSettings, open_mount
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.last_seen import LastSeen
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.night_syncs import NightSyncs
from kochab.gear.mounts.probe import PortInfo, find_served, list_ports, probe_port
from kochab.gear.mounts.serial_line import PORTS
from kochab.gear.mounts.sync_needed import SyncNeeded
from kochab.gear.quick_stop import last_used_path
from kochab.text.translation import tr, tr_noop

DRIVER_DEFAULT = tr_noop("default")
EPOCHS = {DRIVER_DEFAULT: None, str(Epoch.DATE): Epoch.DATE, str(Epoch.J2000): Epoch.J2000}
EPOCH_NAMES = {"J2000": Epoch.J2000, "date": Epoch.DATE}  # as the command line writes them
EXPOSURE_S = 2.0
BAUDS = (300, 4_000_000)

OpenCamera = Callable[[str, str, CaptureSettings], CameraSource]


@frozen
class CameraSelection:
    """Which camera: a name of :data:`kochab.gear.cameras.SOURCES`, its address, and the exposure."""

    source: str
    address: str = ""
    exposure_s: float = EXPOSURE_S

    @property
    def camera(self) -> tuple[str, str]:
        """Which one, whatever its exposure."""
        return self.source, self.address


@frozen
class MountSelection:
    """A port and what listens there; ``baud`` and ``epoch`` are the driver's own when None.

    ``home`` and ``equatorial`` are a person's word of this moment: they are never remembered.
    """

    port: str
    driver: str = "lx200"
    baud: int | None = None
    epoch: Epoch | None = None
    home: Home | None = None
    equatorial: bool = False

    @classmethod
    def typed(
        cls, port: str, driver: str, baud: str, epoch: str, home: Home | None = None, equatorial: bool = False
    ) -> "MountSelection":
        """From what stands in the fields; UsageError says what is wrong.

        Parameters
        ----------
        port, driver, baud, epoch : str
            As they stand in the fields.
        home : Home or None
            When a mount that only counts steps was at its home; None: not said.
        equatorial : bool
            Whether a mount that may be alt-azimuth is on a wedge.
        """
        port, baud = port.strip(), baud.strip()
        if not port and driver not in SERVERS:
            raise UsageError(
                "Choose a port, or type one: {ports}; “Find my mount” looks on all of them.", ports=tr(PORTS)
            )
        rate = None if baud in ("", DRIVER_DEFAULT) else parse_baud(baud)
        return cls(port, driver, rate, EPOCHS.get(epoch), home, equatorial)


def parse_baud(text: str) -> int:
    """A baud rate as it is typed; UsageError when it is none."""
    if not text.isdecimal() or not BAUDS[0] <= int(text) <= BAUDS[1]:
        raise UsageError("“{text}” is not a baud rate: most mounts use 9600 or 115200.", text=text)
    return int(text)


class Meridian(StrEnum):
    """The texts are on the screen."""

    STAYS = tr_noop("German mount: ask before a flip")
    FLIPS = tr_noop("German mount: a goto may flip it")
    CROSSES = tr_noop("Fork or wedge: no flip needed")


def limits_at(meridian: Meridian) -> Limits:
    """The guard's numbers for such a mount."""
    return Limits(allow_flip=meridian is Meridian.FLIPS, crosses_meridian=meridian is Meridian.CROSSES)


# -- Opening a mount behind its guard ----------------------------------------------------------


def guarded(
    selection: MountSelection,
    site: Site | None,
    clock: Callable[[], datetime] | None = None,
    limits: Limits | None = None,
    stop_first: bool = False,
    keep: bool | None = None,
) -> Guard:
    """Open a mount behind its guard; the line can be opened again when it was lost.

    Raises `DeviceError` with one sentence and what to do.

    Parameters
    ----------
    selection : MountSelection
        Driver, port and what was said of the mount.
    site : Site or None
        Where it stands; None: not known.
    clock : Callable[[], datetime] or None
        Gives the time, UTC; None for the computer's. A practice night has its own.
    limits : Limits or None
        Horizon and meridian; None for the usual.
    stop_first : bool
        Send the bytes of Stop before anything is asked.
    keep : bool or None
        Whether what is known of the mount is kept for the next program; None: unless the clock is a practice
        night's.
    """
    kept, now = config_folder() / "mounts", clock or utc_now
    settings = MountSettings(epoch=selection.epoch, site=site, clock=now, equatorial=selection.equatorial, kept=kept)
    again = partial(open_mount, selection.driver, selection.port, selection.baud, stop_first=True, **settings)
    # Home was confirmed for this moment, not for when a lost line is found again.
    mount = again() if stop_first else again(stop_first=False, home=selection.home)
    _remember(selection)
    keep = clock is None if keep is None else keep
    syncs = NightSyncs.of_line(now, kept, selection.port or selection.driver) if keep else None
    line = f"{selection.driver} {selection.port}"
    needed = SyncNeeded.of_line(now, kept, line) if keep else None
    seen = LastSeen.of_line(now, state_folder() / "mounts", line) if keep else None
    guard = Guard(mount, site, limits or Limits(), now, reopen=again, syncs=syncs, needed=needed, last_seen=seen)
    if selection.home is not None:  # a person's word of this moment
        guard.supervisor.watch.trust()
    return guard


def _remember(selection: MountSelection) -> None:
    """For `kochab mount stop`, which has no time to look for the mount."""
    kept = {"port": selection.port, "driver": selection.driver, "baud": selection.baud}
    with suppress(OSError):  # it is found by its questions then
        last_used_path().parent.mkdir(parents=True, exist_ok=True)
        write_atomically(last_used_path(), json.dumps(kept))


def complete(selection: MountSelection) -> Task[MountSelection]:
    """The same with the port and the driver found where none was chosen; nothing moves.

    Raises `UsageError` when there is no such driver, or one of several ports has to be chosen, and `DeviceError` when
    there is no port, or no mount answers on it.
    """
    if selection.driver:
        DRIVERS.check(selection.driver)
    port = selection.port or ("" if selection.driver in SERVERS else _only_port())
    if selection.driver:
        return replace(selection, port=port)
    found = yield from probe_port(port)
    if not found.found:
        raise NoAnswerError(found.advice)
    return replace(selection, port=port, driver=found.driver, baud=selection.baud or found.baud or None)


def _only_port() -> str:
    ports = [port.port for port in list_ports()]
    if len(ports) == 1:
        return ports[0]
    if not ports:
        raise PortError("There is no serial port: plug in the mount's cable, or give --port.")
    raise UsageError(
        "There are {ports} ports, give one with --port: {ports2}.", ports=len(ports), ports2=", ".join(ports)
    )


# -- What a mount's line leads to: a mount on a port, or a simulated telescope -----------------

PRACTICE_FOV_DEG = 4.0  # wide enough for the patterns that are shipped


class Practice(Protocol):
    """A practice night under way: a mount that answers at ``port``, and a camera on it."""

    @property
    def port(self) -> str:
        """Where its mount answers: a device path or ``socket://host:port``."""

    @property
    def driver(self) -> str:
        """The protocol its mount speaks, a name of :data:`kochab.gear.mounts.DRIVERS`."""

    @property
    def camera(self) -> str:
        """The name by which the camera source "simulated" opens its camera."""

    @property
    def rig(self) -> Any:
        """The rig itself (``kochab.simulate.rig``): its clock, weather, bolts and truth."""

    @property
    def folder(self) -> Path | None:
        """Where its frames are written."""

    trouble: str
    """One sentence when something of it failed, which whoever says it empties."""

    def do(self, line: str) -> str:
        """What hands do at the mount, as one typed line, and what came of it."""

    def score(self) -> Any:
        """How far belief and axis are off now (``kochab.simulate.practice``)."""

    def stop(self) -> None:
        """End it and give the port back."""


class PracticeScore(Protocol):
    """How somebody has done: 0 to 100 ``points`` after ``elapsed_s``, and what is left of each error, arcsec.

    ``pointing_arcsec`` leaves out what was asked for, such as turning the bolts; ``off_arcsec`` does not.
    """

    elapsed_s: float
    points: int
    axis_arcsec: float
    pointing_arcsec: float
    off_arcsec: float


StartPractice = Callable[..., Practice]


class Opening:
    """Opens a mount behind its guard in the thread of the line; ``farewell`` is said when it is over.

    ``practice`` is the simulated telescope at the other end, once it has started.
    """

    farewell = ""
    practice: Practice | None = None
    score: PracticeScore | None = None  # of a practice that is over

    def __init__(self, open_guard: Callable[[], Guard]) -> None:
        self._open_guard = open_guard

    def __call__(self) -> Guard:
        """The mount behind its guard; DeviceError with one sentence."""
        return self._open_guard()

    def over(self) -> None:
        """The line is closed."""


def port_opening(selection: MountSelection, site: Site | None, limits: Limits) -> Opening:
    """A mount on a serial port or a socket."""
    return Opening(partial(guarded, selection, site, limits=limits))


class PracticeOpening(Opening):
    """Starts the simulated telescope and connects over its line; it ends with the line.

    ``tell`` hears of it, in the thread of the line.
    """

    def __init__(self, start: StartPractice, tell: Callable[[MountEvent], None], limits: Limits) -> None:
        super().__init__(self._begin)
        self._start, self._tell, self._limits = start, tell, limits

    def _begin(self) -> Guard:
        """Start the practice night and open its mount."""
        self.practice = practice = self._start(fov_deg=PRACTICE_FOV_DEG)
        self._tell(PracticeStarted(practice.port, practice.camera))
        selection = MountSelection(practice.port, practice.driver)
        return guarded(selection, practice.rig.config.site, self.now, self._limits)

    def now(self) -> datetime:
        """The time of the practice night, once it has begun."""
        if self.practice is None:
            return utc_now()
        now: datetime = self.practice.rig.clock.now_utc()
        return now

    def over(self) -> None:
        """End the practice night and keep its score."""
        if self.practice is not None:
            self.score = self.practice.score()
            self.practice.stop()


# -- Finding ports and mounts: questions only, nothing moves -----------------------------------

NO_PORTS = tr_noop(
    "There is no serial port: plug in the USB cable of the mount and switch it on. A mount on the "
    "network is typed as tcp://HOST:PORT, the Wi-Fi of a Sky-Watcher as udp://HOST:11880."
)


def find_ports() -> Task[list[PortInfo]]:
    """The serial ports with what USB tells of them."""
    yield Progress(tr_noop("looking for ports"))
    return list_ports()


def find_mounts(typed: str) -> Task[tuple[list[PortInfo], list[Diagnosis]]]:
    """Ask on every port, first on the one that was typed, which mount is there."""
    try:
        listed = yield from find_ports()
    except PortError:
        if not typed:  # then what answers in the network, if anything does
            if served := find_served():
                return [], served
            raise
        listed = []
    names = [typed] if typed else []
    names += [info.port for info in listed if info.port != typed]
    found = []
    for name in names:
        diagnosis = yield from probe_port(name)
        found.append(diagnosis)
        # The first mount ends the search: each silent port costs seconds of every protocol's questions.
        if diagnosis.found:
            return listed, found
    return listed, found + find_served()


def search_text(found: list[Diagnosis]) -> str:
    """What came of it, with the exact fix where nothing answers."""
    if not found:
        return tr(NO_PORTS)
    notes = []
    for one in found:
        text = tr("{name} on {port} at {baud} baud") if one.baud else tr("{name} on {port}")
        name = text.format(name=one.name, port=one.port, baud=one.baud)
        notes.append(". ".join(w for w in (name if one.found else "", one.advice) if w))
    return "\n".join(notes)
