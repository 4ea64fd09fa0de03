"""A practice night under way: the rig, its mount on a line, its frames in a folder, a score."""

import os
import threading
from dataclasses import dataclass, field, replace
from pathlib import Path

from app.core.capture import CaptureSettings
from app.core.errors import UsageError
from app.core.hint import Site
from app.simulate.line import Line, pty_line, socket_line
from app.simulate.line_faults import Fault, Faults
from app.simulate.responders import RESPONDERS
from app.simulate.responders.base import Responder, open_responder
from app.simulate.responders.skywatcher import SkyWatcher
from app.simulate.rig import PracticeRig, RigConfig
from app.simulate.scenario import misaligned, practice_night, through, tonight
from app.simulate.score import Score, score
from app.simulate.source import SimulatedCamera, announce, withdraw
from app.simulate.telescope import Telescope

KEPT_FRAMES = 200
FAULT_CHANCE = {Fault.SILENCE: 0.01, Fault.GARBAGE: 0.01, Fault.LATE: 0.005, Fault.SPLIT: 0.05}


@dataclass(frozen=True, slots=True)
class PracticeConfig:
    """What is practised with.

    ``line_faults`` lets some answers of the mount be missing, late, split or garbage. Frames of
    ``exposure_s`` are written into ``folder`` as FITS, the oldest beyond 200 removed.
    """

    rig: RigConfig = field(default_factory=lambda: practice_night(misaligned(tonight(), None)))
    driver: str = "lx200"
    socket: bool = False
    folder: Path | None = None
    exposure_s: float = 2.0
    line_faults: bool = False


class Practice:
    """Runs until :meth:`stop`. ``camera`` is the name under which source "simulated" opens it."""

    def __init__(self, config: PracticeConfig) -> None:
        if config.driver not in RESPONDERS:
            names = ", ".join(sorted(RESPONDERS))
            raise UsageError(
                f"There is no simulated mount '{config.driver}'; choose one of {names}."
            )
        self.config = config
        self.rig = PracticeRig(config.rig)
        self.camera = announce(self.rig)
        self.faults = Faults(config.rig.seed)
        if config.line_faults:
            for fault, chance in FAULT_CHANCE.items():
                self.faults.chance(fault, chance)
        self._first = score(self.rig)
        self._over = threading.Event()
        responder = responder_on(config.driver, self.rig)
        serve = socket_line if config.socket else pty_line
        self.line: Line = serve(responder, self.faults)
        self.trouble = ""
        self._writer: threading.Thread | None = None
        if config.folder is not None:
            self._writer = threading.Thread(target=self._write_frames, daemon=True)
            self._writer.start()

    @property
    def port(self) -> str:
        """Where the mount answers: a device path or ``socket://host:port``."""
        return self.line.port

    @property
    def driver(self) -> str:
        """The protocol its mount speaks."""
        return self.config.driver

    def score(self) -> Score:
        """How far belief and axis are off now, and how much better that is than at first."""
        return score(self.rig, self._first)

    def do(self, line: str) -> str:
        """What hands do, as one typed line; UsageError when it is not understood."""
        from app.simulate.commands import obey

        return obey(self, line)

    def stop(self) -> None:
        """End it, give the port back and finish the file being written; may be called twice."""
        self._over.set()
        if self._writer is not None:
            self._writer.join(timeout=10.0)
        self.line.stop()
        withdraw(self.camera)

    def _write_frames(self) -> None:
        from app.frames.fits_write import write_fits

        folder = self.config.folder
        assert folder is not None
        camera = SimulatedCamera(self.rig, CaptureSettings(self.config.exposure_s))
        written: list[Path] = []
        while not self._over.is_set():
            frame = camera.next_frame(0.2)
            if frame is None:
                continue
            path = folder / f"practice-{len(written) + 1:05d}.fits"
            try:
                write_fits(frame, path)
                written.append(path)
                if len(written) > KEPT_FRAMES:
                    written[-1 - KEPT_FRAMES].unlink(missing_ok=True)
            except OSError as error:
                self.trouble = f"Frames cannot be written into {folder}: {error.strerror}."
                return
            if self.rig.clock.rate == 0.0:
                return


def responder_on(driver: str, rig: PracticeRig, telescope: Telescope | None = None) -> Responder:
    """The far end of ``driver`` over the rig's mount, or over a ``telescope`` that passes it on.

    A motor board knows only its counters: they read what the mount's computer believes.
    """
    responder = open_responder(driver, telescope or rig.mount)
    if isinstance(responder, SkyWatcher):
        responder.count_from_home(rig.mount.from_home_deg())
    return responder


def practise(
    driver: str = "lx200", seed: int = 0, site: Site | None = None,
    misalign_arcmin: float | None = None, lost_deg: float = 3.0, rate: float = 1.0,
    faults: bool = False, folder: str | None = None, exposure_s: float = 2.0,
    socket: bool = os.name == "nt", fov_deg: float = 2.4,
) -> Practice:  # fmt: skip
    """Start a practice night told in plain values, as a window or a command line has them.

    Without ``misalign_arcmin`` the seed hides 20 to 90; ``faults`` brings clouds, wind, a kick, a
    weak clutch and a bad line. A pseudo-terminal serves the mount unless ``socket`` asks for TCP.

    Raises
    ------
    app.core.errors.UsageError
        There is no such driver, or the folder cannot be made.

    """
    night = practice_night(misaligned(tonight(seed, site), misalign_arcmin, lost_deg), faults)
    where = None if folder is None else Path(folder)
    rig = through(replace(night, rate=rate), fov_deg)
    return start_practice(PracticeConfig(rig, driver, socket, where, exposure_s, faults))


def start_practice(config: PracticeConfig | None = None) -> Practice:
    """Start a practice night; UsageError or PortError says why that is not possible."""
    config = config or PracticeConfig()
    if config.folder is not None:
        try:
            config.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"{config.folder} cannot be a folder: {error.strerror}.") from None
    return Practice(config)
