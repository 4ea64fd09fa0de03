"""A practice night under way: the rig, its mount on a line, its frames in a folder, a score."""

import math
import os
import threading
from dataclasses import replace
from pathlib import Path

from kochab.core.attitude import apart_deg
from kochab.core.capture import CaptureSettings
from kochab.core.errors import UsageError
from kochab.core.frame import Site
from kochab.core.values import frozen
from kochab.simulate.camera_source import SimulatedCamera, announce, withdraw
from kochab.simulate.responders import RESPONDERS, open_responder
from kochab.simulate.rig import PracticeRig, RigConfig, misaligned, practice_night, through, tonight
from kochab.simulate.serial_line import Fault, Faults, Line, own_line, socket_line
from kochab.text.angle_text import angle_text
from kochab.text.translation import tr

# -- What a person does at the mount on a practice night, as typed lines ------------------------

MOST_ARCMIN = 10_800.0
"""Nothing is turned further than half around at once, by bolt or by hand."""
MOST_DEG = 180.0
MOST_FAULTS = 1000

HELP = (
    "alt ARCMIN    turn the altitude bolt: + raises the axis",
    "az ARCMIN     turn the azimuth bolt: + is clockwise from above",
    "ra DEG        open the clutch and turn the RA axis, + to the west",
    "dec DEG       open the clutch and turn the Dec axis",
    "track on|off  the mount's motor",
    "pull, plug    the cable",
    "fault NAME N  the next N answers: silence, garbage, late, split, wrong, refusal, unplug",
    "score         pointing and polar alignment errors",
    "help, quit",
)


def _checked_number(word: str, most: float) -> float:
    """The number that was typed, no larger than a hand would turn anything."""
    value = float(word)
    if not abs(value) <= most:
        raise UsageError("{word} is not between {most:g} and {most2:g}.", word=word, most=-most, most2=most)
    return value


# -- How well somebody has done on the practice rig --------------------------------------------

POINTING_GOAL_ARCSEC = 60.0
AXIS_GOAL_ARCSEC = 30.0
WORST_ARCSEC = 3600.0  # where points run out for who began better than that


@frozen
class Score:
    """``off_arcsec``: between where the mount believes to point and where it does.

    ``pointing_arcsec``: the same, but for turns of axes and bolts that somebody was asked for since the last sync.
    ``axis_arcsec``: between the axis and the refracted pole. ``points`` 0 to 100: half for each,
    full at 1 arcmin and 30 arcsec, none where they were at the beginning, by their logarithms.
    """

    elapsed_s: float
    pointing_arcsec: float
    axis_arcsec: float
    axis_altitude_arcsec: float
    axis_azimuth_arcsec: float
    points: int
    off_arcsec: float = 0.0

    def as_text(self) -> str:
        """One line for a person."""
        vertical = "high" if self.axis_altitude_arcsec > 0 else "low"
        around = "clockwise" if self.axis_azimuth_arcsec > 0 else "anticlockwise"
        pointing = _grade(self.pointing_arcsec, POINTING_GOAL_ARCSEC)
        axis = _grade(self.axis_arcsec, AXIS_GOAL_ARCSEC)
        return (
            f"Score {self.points} of 100 after {self.elapsed_s / 60.0:.0f} min."
            f" Pointing {angle_text(self.pointing_arcsec / 3600.0)} off: {pointing}."
            f" Polar axis {angle_text(self.axis_arcsec / 3600.0)} off: {axis};"
            f" {angle_text(abs(self.axis_altitude_arcsec) / 3600.0)} too {vertical} and"
            f" {angle_text(abs(self.axis_azimuth_arcsec) / 3600.0)} too far {around} from above."
        )


def _grade(error_arcsec: float, goal_arcsec: float) -> str:
    if error_arcsec <= goal_arcsec:
        return "excellent"
    return "good" if error_arcsec <= 4.0 * goal_arcsec else "not there yet"


def score(rig: PracticeRig, first: Score | None = None) -> Score:
    """The score now, against ``first``, which was taken at the beginning."""
    truth = rig.truth()
    blameless = truth.sky.of_date(truth.sky.from_enu(rig.mount.before_bolts(truth.enu_to_camera[2])))
    pointing = apart_deg(rig.mount.believed_deg(asked=True), blameless) * 3600.0
    off = apart_deg(rig.mount.believed_deg(), truth.of_date_deg) * 3600.0
    error = truth.axis_error()
    began = (first.pointing_arcsec, first.axis_arcsec) if first else (0.0, 0.0)
    points = _share(pointing, began[0], POINTING_GOAL_ARCSEC)
    points += _share(error.total_arcsec, began[1], AXIS_GOAL_ARCSEC)
    return Score(
        truth.unix_s - rig.start_unix,
        pointing,
        error.total_arcsec,
        error.altitude_arcsec,
        error.azimuth_arcsec,
        round(50.0 * points),
        off,
    )


def _share(value: float, began: float, goal: float) -> float:
    worst = max(began, WORST_ARCSEC)
    # logarithms: halving an error earns the same wherever it stands
    left = math.log(max(value, goal) / goal) / math.log(worst / goal)
    return 1.0 - min(left, 1.0)


KEPT_FRAMES = 200
FAULT_CHANCE = {Fault.SILENCE: 0.01, Fault.GARBAGE: 0.01, Fault.LATE: 0.005, Fault.SPLIT: 0.05}


class PracticeNight:
    """Runs until :meth:`stop`. ``camera`` is the name under which source "simulated" opens it.

    ``driver`` is the protocol its mount speaks. ``line_faults`` lets some answers of the mount be missing, late,
    split or garbage. Frames of ``exposure_s`` are written into ``folder`` as FITS, the oldest beyond 200 removed.

    Raises `UsageError` when there is no such driver, or the folder cannot be made, and `PortError` when the mount
    cannot be served on a line.
    """

    def __init__(
        self,
        rig: RigConfig,
        driver: str = "lx200",
        socket: bool = False,
        folder: Path | None = None,
        exposure_s: float = 2.0,
        line_faults: bool = False,
    ) -> None:
        if driver not in RESPONDERS:
            names = ", ".join(sorted(RESPONDERS))
            raise UsageError(
                "There is no simulated mount '{driver}'; choose one of {names}.", driver=driver, names=names
            )
        if folder is not None:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise UsageError(
                    "{folder} cannot be used as a folder: {strerror}.", folder=folder, strerror=error.strerror
                ) from None
        self.driver, self.folder = driver, folder
        self.rig = PracticeRig(rig)
        self.camera = announce(self.rig)
        self.faults = Faults(rig.seed)
        if line_faults:
            for fault, chance in FAULT_CHANCE.items():
                self.faults.chance(fault, chance)
        self._first = score(self.rig)
        self._over = threading.Event()
        serve = socket_line if socket else own_line
        self.line: Line = serve(open_responder(driver, self.rig.mount), self.faults)
        self.trouble = ""
        self._writer: threading.Thread | None = None
        if folder is not None:
            self._writer = threading.Thread(target=self._write_frames, args=(folder, exposure_s), daemon=True)
            self._writer.start()

    @property
    def port(self) -> str:
        """Where the mount answers: a device path or ``socket://host:port``."""
        return self.line.port

    def score(self) -> Score:
        """How far belief and axis are off now, and how much better that is than at first."""
        return score(self.rig, self._first)

    def do(self, line: str) -> str:
        """Do one typed line and say what was done, "" when there is nothing to say.

        Raises `UsageError` when the line is not understood.
        """
        action, *words = line.split() or [""]
        try:
            return self._do(action.lower(), words)
        except (ValueError, IndexError):
            raise UsageError("'{line}' is not complete or not a number; type help.", line=line.strip()) from None

    def _do(self, action: str, words: list[str]) -> str:
        mount = self.rig.mount
        match action:
            case "":
                return ""
            case "alt":
                mount.turn_bolts(_checked_number(words[0], MOST_ARCMIN), 0.0, asked=True)
                return "Altitude bolt turned."
            case "az":
                mount.turn_bolts(0.0, _checked_number(words[0], MOST_ARCMIN), asked=True)
                return "Azimuth bolt turned."
            case "ra":
                mount.turn_by_hand(_checked_number(words[0], MOST_DEG), asked="asked" in words)
                return "RA axis turned by hand; the mount has not noticed."
            case "dec":
                mount.turn_by_hand(0.0, _checked_number(words[0], MOST_DEG), "asked" in words)
                return "Dec axis turned by hand; the mount has not noticed."
            case "track":
                mount.tracking = ("off", "on").index(words[0]) == 1
                return f"Tracking is {words[0]}."
            case "pull":
                self.line.unplug()
                return "Cable pulled."
            case "plug":
                self.line.plug()
                return f"Cable plugged in at {self.port}."
            case "fault":
                count = int(words[1]) if len(words) > 1 else 1
                if not 1 <= count <= MOST_FAULTS:
                    raise UsageError(
                        "{count} is not a count of answers from 1 to {most}.", count=count, most=MOST_FAULTS
                    )
                self.faults.next(words[0], count)
                return f"{words[0].capitalize()} for the next {count}."
            case "score":
                return self.score().as_text()
            case "help":
                return "\n".join(HELP)
        raise UsageError("There is no command '{action}'; type help.", action=action)

    def stop(self) -> None:
        """End it, give the port back and finish the file being written; may be called twice."""
        self._over.set()
        if self._writer is not None:
            self._writer.join(timeout=10.0)
        self.line.stop()
        withdraw(self.camera)

    def _write_frames(self, folder: Path, exposure_s: float) -> None:
        from kochab.frames.fits_write import write_fits

        camera = SimulatedCamera(self.rig, CaptureSettings(exposure_s))
        written: list[Path] = []
        number = 0
        while not self._over.is_set():
            frame = camera.next_frame(0.2)
            if frame is None:
                continue
            number += 1
            while (path := folder / f"practice-{number:05d}.fits").exists():
                number += 1  # another night's frames stay
            try:
                write_fits(frame, path)
                written.append(path)
                if len(written) > KEPT_FRAMES:
                    written[-1 - KEPT_FRAMES].unlink(missing_ok=True)
            except OSError as error:
                why = error.strerror
                self.trouble = tr("Frames cannot be written into {folder}: {why}.", folder=folder, why=why)
                return
            if self.rig.clock.rate == 0.0:
                return


def practise(
    driver: str = "lx200",
    seed: int = 0,
    site: Site | None = None,
    misalign_arcmin: float | None = None,
    lost_deg: float = 3.0,
    rate: float = 1.0,
    faults: bool = False,
    folder: str | None = None,
    exposure_s: float = 2.0,
    socket: bool = os.name == "nt",
    fov_deg: float = 2.4,
) -> PracticeNight:
    """Start a practice night from plain values, as a window or a command line has them.

    Parameters
    ----------
    driver : str
        Name of the mount's driver.
    seed : int
        Draws the night.
    site : Site or None
        Where it is; None: the seed's.
    misalign_arcmin : float or None
        Polar error; None: the seed hides 20 to 90.
    lost_deg : float
        How far the mount's sync is off.
    rate : float
        How many times faster than real time the night goes.
    faults : bool
        Clouds, wind, a kick, a weak clutch and a bad line.
    folder : str or None
        Where frames are written; None: nowhere.
    exposure_s : float
        Of each frame.
    socket : bool
        Serve the mount by TCP in place of a pseudo-terminal, which Windows has not: there it always is.
    fov_deg : float
        Width of the camera's field.
    """
    night = practice_night(misaligned(tonight(seed, site), misalign_arcmin, lost_deg), faults)
    where = None if folder is None else Path(folder)
    rig = through(replace(night, rate=rate), fov_deg)
    return PracticeNight(rig, driver, socket, where, exposure_s, faults)
