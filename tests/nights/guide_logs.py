"""Guide logs of a mount whose polar axis is known, written as PHD2 writes them: a truth that the estimator had no part in.

``python -m tests.nights.guide_logs OUT --count 200 --seed 1`` writes the logs and ``truth.json``;
``python -m tests.nights.guide_logs --score 200 --seed 1`` gives them to ``kochab polar`` and prints how many axes lie
inside their 95 % ellipse and reported/true, by kind and by seeing.

The star is an ICRS place seen through erfa's atmosphere; the mount turns rigidly about its own axis at the sidereal
rate; PHD2's guider (mount.cpp, guide_algorithm_hysteresis.cpp, guide_algorithm_resistswitch.cpp, guidinglog.cpp of
OpenPHDGuiding/phd2) answers what the camera sees, and the mount answers the guider with rates, play and parity of its
own. Nothing of :mod:`kochab` is used to make a log.
"""

import argparse
import json
import math
from collections import defaultdict
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime, timedelta
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import erfa
import numpy as np

ARCSEC = math.pi / 648000.0
SIDEREAL_RAD_S = 2 * math.pi * 1.00273781191135448 / 86400.0
SIDEREAL_ARCSEC_S = SIDEREAL_RAD_S / ARCSEC
TEMPERATURE_C = 10.0
KINDS = ("plain", "dither", "parity reversed", "calibration wrong", "two sections", "assistant", "clouds", "ASIAIR")
SEEING_PX = (0.02, 0.08, 0.15, 0.22, 0.30)


@dataclass(frozen=True)
class Section:
    """One stretch of guiding at one target: where, how long and which side of the pier."""

    start_s: float
    minutes: float
    hour_angle_deg: float
    dec_deg: float
    dec_parity: int  # +1: PHD2's "+", a north pulse takes the telescope north; -1: its "-"
    pier: str


@dataclass(frozen=True)
class Evening:
    """All that is true of one log. Axis errors against the refracted pole: azimuth clockwise seen from above, altitude up."""

    kind: str
    seed: int
    latitude_deg: float
    longitude_deg: float
    height_m: float
    utc: str
    utc_offset_h: float
    azimuth_error_deg: float
    altitude_error_deg: float
    scale_arcsec_px: float
    exposure_s: float
    seeing_px: float
    guide_rate: float  # times sidereal, as the mount truly answers
    calibrated_over_true: tuple[float, float]  # RA, Dec: what the calibration holds a pulse to be worth
    backlash_arcsec: float
    periodic_arcsec: float
    period_s: float
    camera_angle_deg: float
    mirrored: bool
    skew_deg: float  # the calibrated Dec angle is off a right angle by this
    parity_written: bool
    sections: tuple[Section, ...] = field(default=())
    pointing_deg: tuple[float, float] = (0.0, 0.0)  # hour angle and Dec that the mount reports, less where it is


def evening(kind: str, seed: int) -> Evening:
    """Draw one evening of a kind; the same seed gives the same evening."""
    random = np.random.default_rng([seed, KINDS.index(kind)])
    south = random.random() < 0.25
    latitude = random.uniform(20, 58) * (-1 if south else 1)
    total, direction = random.uniform(2, 60) / 60, random.uniform(0, 2 * math.pi)
    wrong = random.choice([0.7, 1.3]) if kind == "calibration wrong" else 1.0
    drawn = Evening(
        kind,
        seed,
        latitude,
        random.uniform(-180, 180),
        random.uniform(0, 1800),
        (datetime(2026, 1, 1, 20, tzinfo=UTC) + timedelta(days=random.uniform(0, 360))).isoformat(),
        float(random.integers(-8, 9)),
        total * math.sin(direction) / math.cos(math.radians(latitude)),
        total * math.cos(direction),
        random.uniform(1.0, 6.0),
        float(random.choice([1.0, 2.0, 3.0, 4.0])),
        SEEING_PX[seed % len(SEEING_PX)],
        float(random.choice([0.5, 0.9])),
        (wrong * random.normal(1, 0.03), wrong * random.normal(1, 0.03)),
        random.choice([0.0, random.uniform(1, 8)]),
        random.uniform(3, 15),
        random.uniform(300, 640),
        random.uniform(-180, 180),
        bool(random.random() < 0.5),
        random.normal(0, 1.0),
        kind != "ASIAIR",
    )
    while True:
        aimed = replace(drawn, sections=_sections(kind, random))
        if all(_lowest_deg(aimed, section) > 25 for section in aimed.sections):
            return aimed


def _lowest_deg(night: Evening, section: Section) -> float:
    """The lower of the altitudes at the section's ends."""
    latitude, dec = math.radians(night.latitude_deg), math.radians(section.dec_deg)
    turned = section.minutes / 4
    return min(
        math.degrees(
            math.asin(
                math.sin(latitude) * math.sin(dec) + math.cos(latitude) * math.cos(dec) * math.cos(math.radians(angle))
            )
        )
        for angle in (section.hour_angle_deg, section.hour_angle_deg + turned)
    )


def _sections(kind: str, random: np.random.Generator) -> tuple[Section, ...]:
    parity = -1 if kind == "parity reversed" or (kind != "plain" and random.random() < 0.3) else 1
    minutes = random.uniform(8, 20) if kind == "assistant" else random.uniform(40, 150)
    side = random.choice([-1, 1])
    first = Section(0.0, minutes, side * random.uniform(5, 60), random.uniform(-70, 75), parity, _pier(side))
    if kind != "two sections":
        return (first,)
    other = -side
    return first, Section(
        minutes * 60 + random.uniform(120, 900),
        random.uniform(30, 100),
        other * random.uniform(5, 60),
        random.uniform(-70, 75),
        -parity,  # PHD2 flips the calibration with the pier side, and the Dec parity with it
        _pier(other),
    )


def _pier(side: int) -> str:
    return "West" if side < 0 else "East"


def pressure_hpa(height_m: float) -> float:
    """The standard atmosphere's pressure at a height (ICAO)."""
    return 1013.25 * (1 - 2.25577e-5 * height_m) ** 5.25588


def observed_enu(night: Evening, star: tuple[float, float], seconds: np.ndarray) -> np.ndarray:
    """East, north, up of an ICRS place (radians) as refracted at the site, at times after the log's start; (N, 3)."""
    utc = _julian(night)
    azimuth, zenith, *_ = erfa.atco13(
        *star, 0, 0, 0, 0, utc, np.asarray(seconds) / 86400.0, 0.0,
        math.radians(night.longitude_deg), math.radians(night.latitude_deg), night.height_m,
        0, 0, pressure_hpa(night.height_m), TEMPERATURE_C, 0.5, 0.55,
    )  # fmt: skip
    return np.stack([np.sin(azimuth) * np.sin(zenith), np.cos(azimuth) * np.sin(zenith), np.cos(zenith)], axis=-1)


def _julian(night: Evening) -> float:
    start = datetime.fromisoformat(night.utc)
    return 2440587.5 + start.timestamp() / 86400.0


def refracted_pole(night: Evening) -> tuple[float, float]:
    """Azimuth and altitude of the refracted pole of date that is above the horizon, radians."""
    refraction = erfa.refco(pressure_hpa(night.height_m), TEMPERATURE_C, 0.5, 0.55)
    true = math.pi / 2 - abs(math.radians(night.latitude_deg))
    observed = true
    for _ in range(5):
        observed = true - refraction[0] * math.tan(observed) - refraction[1] * math.tan(observed) ** 3
    return (0.0 if night.latitude_deg > 0 else math.pi), math.pi / 2 - observed


def axis_enu(night: Evening) -> np.ndarray:
    """The mount's axis, towards the pole above the horizon."""
    azimuth, altitude = refracted_pole(night)
    azimuth += math.radians(night.azimuth_error_deg)
    altitude += math.radians(night.altitude_error_deg)
    return np.array(
        [math.sin(azimuth) * math.cos(altitude), math.cos(azimuth) * math.cos(altitude), math.sin(altitude)]
    )


def place_in_mount(night: Evening, directions: np.ndarray, seconds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hour angle (westward, radians) less what the drive has turned since the start, and declination, about the mount's axis."""
    axis = axis_enu(night) * (1 if night.latitude_deg > 0 else -1)
    west = -np.cross(axis, [0.0, 0.0, 1.0])  # the axis turned towards the celestial north pole, in both hemispheres
    west /= np.linalg.norm(west)
    meridian = np.cross(axis, west)
    if meridian[2] < 0:
        meridian = -meridian
    along_west, along_meridian = directions @ west, directions @ meridian
    hour_angle = np.arctan2(along_west, along_meridian) - SIDEREAL_RAD_S * np.asarray(seconds)
    return np.unwrap(hour_angle), np.arcsin(np.clip(directions @ axis, -1, 1))


class Hysteresis:
    """guide_algorithm_hysteresis.cpp with its defaults."""

    def __init__(self, minimum_px: float) -> None:
        self.minimum, self.last = minimum_px, 0.0

    def result(self, offset: float) -> float:
        self.last = 0.0 if abs(offset) < self.minimum else 0.7 * (0.9 * offset + 0.1 * self.last)
        return self.last

    def reset(self) -> None:
        self.last = 0.0


class ResistSwitch:
    """guide_algorithm_resistswitch.cpp with aggression 100 % and fast switch."""

    def __init__(self, minimum_px: float) -> None:
        self.minimum = minimum_px
        self.reset()

    def reset(self) -> None:
        self.history, self.side = [0.0] * 10, 0.0

    def result(self, offset: float) -> float:
        self.history = [*self.history[1:], offset]
        if abs(offset) < self.minimum:
            return 0.0
        sign = math.copysign(1.0, offset)
        if sign != self.side and abs(offset) > 3 * self.minimum:
            self.side, self.history = 0.0, [0.0] * 7 + [offset] * 3
        votes = sum(math.copysign(1.0, past) for past in self.history if abs(past) > self.minimum)
        if self.side == 0 or votes * self.side < 0:
            worse = abs(sum(self.history[-3:])) > abs(sum(self.history[:3]))
            if abs(votes) < 3 or not worse:
                return 0.0
            self.side = math.copysign(1.0, votes)
        return offset if self.side == sign else 0.0


@dataclass
class Play:
    """A gear with play: what the motor does reaches the telescope once the gap is closed."""

    width: float
    motor: float = 0.0
    telescope: float = 0.0

    def turn(self, amount: float) -> None:
        self.motor += amount
        self.telescope = min(max(self.telescope, self.motor - self.width), self.motor)


class Guider:
    """PHD2, its camera and the mount through one section; writes the section's rows."""

    def __init__(self, night: Evening, section: Section, random: np.random.Generator) -> None:
        self.night, self.section, self.random = night, section, random
        self.star = _star(night, section)
        seconds = section.start_s + np.arange(0.0, section.minutes * 60 + 120, 5.0)
        hour_angle, declination = place_in_mount(night, observed_enu(night, self.star, seconds), seconds)
        self._times = seconds - section.start_s
        self._west = (hour_angle - hour_angle[0]) * math.cos(declination[0]) / ARCSEC
        self._north = (declination - declination[0]) / ARCSEC
        self.cos_dec = math.cos(declination[0])
        # arcsec the telescope was moved from where it would have tracked to: west and north, by pulses
        self.pulsed_west, self.play = 0.0, Play(night.backlash_arcsec, telescope=0.0)
        self.phase = random.uniform(0, 2 * math.pi)
        self.lock = np.array([random.uniform(300, 900), random.uniform(200, 700)])
        flipped = math.pi * (section.pier == "East")
        self.x_angle = math.radians(night.camera_angle_deg) + flipped
        self.south_angle = self.x_angle + math.pi / 2 * (-1 if night.mirrored else 1)
        square = self.south_angle + (0 if section.dec_parity > 0 else math.pi)
        self.y_angle = square + math.radians(night.skew_deg)
        rate = night.guide_rate * SIDEREAL_ARCSEC_S
        over_ra, over_dec = night.calibrated_over_true
        self.x_rate = rate * self.cos_dec / night.scale_arcsec_px * over_ra  # px/s that PHD2 believes
        self.y_rate = rate / night.scale_arcsec_px * over_dec
        self.ra, self.dec = Hysteresis(self.minimum), ResistSwitch(self.minimum)
        self.enabled = night.kind != "assistant"

    @property
    def minimum(self) -> float:
        return 0.15 if self.night.seeing_px < 0.1 else 0.2

    def seen(self, time_s: float) -> np.ndarray:
        """The star's place on the camera, without seeing, px."""
        turn = 2 * math.pi * time_s / self.night.period_s + self.phase
        wander = self.night.periodic_arcsec * (
            math.sin(turn) + 0.3 * math.sin(2 * turn + 1) - math.sin(self.phase) - 0.3 * math.sin(2 * self.phase + 1)
        )
        west = np.interp(time_s, self._times, self._west) - self.pulsed_west - wander * self.cos_dec
        south = self.play.telescope - np.interp(time_s, self._times, self._north)
        direction = west * _unit(self.x_angle) + south * _unit(self.south_angle)
        return self._origin + direction / self.night.scale_arcsec_px

    def to_mount(self, offset: np.ndarray) -> tuple[float, float]:
        """Mount::TransformCameraCoordinatesToMountCoordinates."""
        length, theta = float(np.hypot(*offset)), math.atan2(offset[1], offset[0])
        error = self.x_angle - self.y_angle + math.pi / 2
        return math.cos(theta - self.x_angle) * length, math.sin(theta - self.x_angle - error) * length

    def rows(self) -> list[str]:
        """Frames and messages between the header and "Guiding Ends"."""
        night, random = self.night, self.random
        self._origin = self.lock.copy()
        clock, lines, frame = 0.0, [], 0
        lost_until, next_dither = -1.0, random.uniform(300, 700)
        if not self.enabled:
            lines.append("INFO: Guiding parameter change, MountGuidingEnabled = false")
        while clock < self.section.minutes * 60:
            frame += 1
            middle = clock + night.exposure_s / 2
            clock += night.exposure_s + 0.05 + random.gamma(2.0, 0.08)
            if night.kind == "clouds" and clock > lost_until and random.random() < 0.004:
                lost_until = clock + random.choice([night.exposure_s, random.uniform(20, 400)])
            if clock < lost_until:
                lines.append(
                    f'{frame},{clock:.3f},"DROP",,,,,,,,,,,,,{random.uniform(0, 90):.0f},{random.uniform(1, 3):.2f},1,"Star lost - low SNR"'
                )
                continue
            offset = self.seen(middle) + random.normal(0, night.seeing_px, 2) - self.lock
            clock, line = self._guide(frame, clock, offset)
            lines.append(line)
            if night.kind in ("dither", "ASIAIR") and clock > next_dither:
                next_dither = clock + random.uniform(300, 700)
                lines += self._dither()
        if not self.enabled:
            lines.append("INFO: Guiding parameter change, MountGuidingEnabled = true")
        self.duration_s = clock
        return lines

    def _guide(self, frame: int, clock: float, offset: np.ndarray) -> tuple[float, str]:
        x, y = self.to_mount(offset)
        guide_x, guide_y = self.ra.result(x), self.dec.result(y)
        ra_ms = min(math.floor(abs(guide_x) / self.x_rate * 1000 + 0.5), 2500) if self.enabled else 0
        dec_ms = min(math.floor(abs(guide_y) / self.y_rate * 1000 + 0.5), 2500) if self.enabled else 0
        west = 1 if guide_x > 0 else -1
        south = 1 if guide_y > 0 else -1
        arcsec_ms = self.night.guide_rate * SIDEREAL_ARCSEC_S / 1000
        self.pulsed_west += west * ra_ms * arcsec_ms * self.cos_dec
        self.play.turn(-south * self.section.dec_parity * dec_ms * arcsec_ms)
        clock += (ra_ms + dec_ms) / 1000  # MoveAxis waits for its pulse; the row's time is taken afterwards
        mass = self.random.normal(2500, 120)
        ra = f"{ra_ms},{'W' if west > 0 else 'E'}" if ra_ms else "0,"
        dec = f"{dec_ms},{'S' if south > 0 else 'N'}" if dec_ms else "0,"
        return clock, (
            f'{frame},{clock:.3f},"Mount",{offset[0]:.3f},{offset[1]:.3f},{x:.3f},{y:.3f},{guide_x:.3f},{guide_y:.3f},'
            f"{ra},{dec},,,{mass:.0f},{math.sqrt(mass) * 0.7:.2f},0"
        )

    def _dither(self) -> list[str]:
        """MyFrame::Dither: the lock position moves by a step in RA and Dec, written in mount pixels."""
        step = self.random.uniform(-3, 3, 2)
        theta = math.atan2(step[1], step[0])
        if abs(math.remainder(self.x_angle - self.y_angle + math.pi / 2, 2 * math.pi)) > math.pi / 2:
            theta = -theta
        self.lock = self.lock + np.hypot(*step) * _unit(theta + self.x_angle)
        self.ra.reset()
        self.dec.reset()
        return [
            f"INFO: DITHER by {step[0]:.3f}, {step[1]:.3f}, new lock pos = {self.lock[0]:.3f}, {self.lock[1]:.3f}",
            "INFO: SETTLING STATE CHANGE, Settling started",
        ]

    def header(self, parity_written: bool, start: str) -> list[str]:
        """GuidingLog::GuidingHeader."""
        night, section = self.night, self.section
        angles = [math.degrees(math.remainder(angle, 2 * math.pi)) for angle in (self.x_angle, self.y_angle)]
        parity = f"+/{'+' if section.dec_parity > 0 else '-'}" if parity_written else "?/?"
        return [
            f"Guiding Begins at {start}",
            "Dither = both axes, Dither scale = 1.000, Image noise reduction = none, Guide-frame time lapse = 0, Server enabled",
            f"Pixel scale = {night.scale_arcsec_px:.2f} arc-sec/px, Binning = 1, Focal length = {206.265 * 3.75 / night.scale_arcsec_px:.0f} mm",
            "Search region = 15 px, Star mass tolerance = 50.0%",
            "Equipment Profile = Nights",
            "Camera = ZWO ASI120MM Mini, gain = 50, full size = 1280 x 960, no dark, no defect map, pixel size = 3.8 um",
            f"Exposure = {night.exposure_s * 1000:.0f} ms",
            f"Mount = EQMOD HEQ5/6,  connected, guiding enabled, xAngle = {angles[0]:.1f}, xRate = {self.x_rate:.3f}, "
            f"yAngle = {angles[1]:.1f}, yRate = {self.y_rate:.3f}, parity = {parity}, ",
            f"X guide algorithm = Hysteresis, Hysteresis = 0.100, Aggression = 0.700, Minimum move = {self.minimum:.3f}",
            f"Y guide algorithm = Resist Switch, Minimum move = {self.minimum:.3f} Aggression = 100% FastSwitch = enabled",
            "Backlash comp = disabled, pulse = 0 ms",
            "Calibration step = phdlab_placeholder, Max RA duration = 2500, Max DEC duration = 2500, DEC guide mode = Auto",
            "RA Guide Speed = Unknown, Dec Guide Speed = Unknown, Cal Dec = 2.0, Last Cal Issue = None, Timestamp = Unknown",
            f"Dec = {section.dec_deg + night.pointing_deg[1]:.1f} deg, Hour angle = {(section.hour_angle_deg + night.pointing_deg[0]) / 15:.2f} hr, Pier side = {section.pier}, Rotator pos = N/A",
            f"Lock position = {self.lock[0]:.3f}, {self.lock[1]:.3f}, Star position = {self.lock[0]:.3f}, {self.lock[1]:.3f}, HFD = 3.10 px",
            "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration,RADirection,"
            "DECDuration,DECDirection,XStep,YStep,StarMass,SNR,ErrorCode",
        ]


def _unit(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), math.sin(angle)])


def _star(night: Evening, section: Section) -> tuple[float, float]:
    """ICRS place that has the section's apparent hour angle and declination of date when it starts, radians."""
    utc, day = _julian(night), section.start_s / 86400
    tt = utc + 69.184 / 86400
    sidereal = erfa.gst06a(utc, day, tt, day) + math.radians(night.longitude_deg)
    right_ascension = sidereal - math.radians(section.hour_angle_deg)
    origins = erfa.eo06a(tt, day)
    ra, dec, _ = erfa.atic13(erfa.anp(right_ascension + origins), math.radians(section.dec_deg), tt, day)
    return float(ra), float(dec)


def write_log(night: Evening, path: Path) -> dict:
    """Write the log; gives the truth of it as JSON takes it."""
    random = np.random.default_rng([night.seed, KINDS.index(night.kind), 7])
    local = datetime.fromisoformat(night.utc) + timedelta(hours=night.utc_offset_h)
    lines = [f"PHD2 version 2.6.13 [Windows], Log version 2.5. Log enabled at {_stamp(local, -30)}", ""]
    for section in night.sections:
        guider = Guider(night, section, random)
        lines += guider.header(night.parity_written, _stamp(local, section.start_s))
        lines += guider.rows()
        lines += [f"Guiding Ends at {_stamp(local, section.start_s + guider.duration_s)}", ""]
    lines.append(f"Log closed at {_stamp(local, 20000)}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return {"file": path.name, **asdict(night)}


def _stamp(local: datetime, seconds: float) -> str:
    return (local + timedelta(seconds=seconds)).strftime("%Y-%m-%d %H:%M:%S")


def evenings(count: int, seed: int) -> list[Evening]:
    """So many evenings, the kinds in turn and every seeing in every kind."""
    return [evening(KINDS[number % len(KINDS)], 1000 * seed + number // len(KINDS)) for number in range(count)]


def write_all(folder: Path, count: int, seed: int) -> list[dict]:
    """Logs and ``truth.json`` in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    truths = [
        write_log(night, folder / f"PHD2_GuideLog_{number:03d}.txt")
        for number, night in enumerate(evenings(count, seed))
    ]
    (folder / "truth.json").write_text(json.dumps(truths, indent=1))
    return truths


CHI2_95, CHI2_68 = 5.991, 2.296


@dataclass(frozen=True)
class Score:
    """One log's answer beside its truth. ``verdict``: inside, outside (said without doubt), doubted or refused."""

    file: str
    kind: str
    seeing_px: float
    verdict: str
    distance: float  # Mahalanobis; 2.45 is the 95 % ellipse
    along: float  # reported/true where the drift knows it best; nan where the truth is less than three sigma there
    total: float  # reported/true; nan where the sigma of the total is over a quarter of it
    said: str


def score(night: Evening, path: Path) -> Score:
    """What ``kochab polar`` makes of a log; where the log hides the Dec sign, it may only answer once it is said."""
    code, answer = _asked(night, path)
    if not night.parity_written and "altitude_error_arcsec" in answer:
        unsaid_is_doubted = code != 0 and answer["spoilt"]
        code, answer = _asked(night, path, "--dec-sign=" + ("+" if night.sections[-1].dec_parity > 0 else "-"))
        if not unsaid_is_doubted:
            return Score(
                path.name, night.kind, night.seeing_px, "outside", math.nan, math.nan, math.nan, "one answer of two"
            )
    if "altitude_error_arcsec" not in answer:
        return Score(
            path.name,
            night.kind,
            night.seeing_px,
            "refused",
            math.nan,
            math.nan,
            math.nan,
            answer.get("error", "")[:90],
        )
    distance, along, total = compare(night, answer)
    doubted = code != 0 or answer["spoilt"]
    verdict = "doubted" if doubted else "inside" if distance**2 <= CHI2_95 else "outside"
    findings = ",".join(finding["code"] for finding in answer["findings"])
    return Score(path.name, night.kind, night.seeing_px, verdict, distance, along, total, findings)


def _asked(night: Evening, path: Path, *more: str) -> tuple[int, dict]:
    from kochab.__main__ import main

    site = f"--site={night.latitude_deg:.5f},{night.longitude_deg:.5f},{night.height_m:.0f}"
    said = StringIO()
    with redirect_stdout(said):
        code = main(["polar", str(path), "--json", site, f"--utc-offset={night.utc_offset_h:g}", *more])
    return int(code or 0), json.loads(said.getvalue().splitlines()[-1])


def compare(night: Evening, answer: dict) -> tuple[float, float, float]:
    """Mahalanobis distance of the truth from the answer, and reported/true along the best known direction and in all."""
    on_sky = math.cos(math.radians(night.altitude_error_deg) + refracted_pole(night)[1])
    true = np.array([night.azimuth_error_deg * on_sky, night.altitude_error_deg]) * 3600
    told = np.array([answer["azimuth_error_on_sky_arcsec"], answer["altitude_error_arcsec"]])
    long, short = np.array(answer["ellipse_arcsec"]) / math.sqrt(CHI2_68)
    turn = math.radians(answer["ellipse_from_azimuth_deg"])
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    apart, truth, told_along = axes @ (told - true), axes @ true, axes @ told
    along = told_along[1] / truth[1] if abs(truth[1]) > 3 * short else math.nan
    known = answer["sigma_total_arcsec"] < 0.25 * np.linalg.norm(true)
    total = float(np.linalg.norm(told) / np.linalg.norm(true)) if known else math.nan
    return float(np.hypot(apart[0] / long, apart[1] / short)), float(along), total


def report(scores: list[Score]) -> str:
    """A line a kind and a seeing."""
    lines = [
        f"{'':22}{'logs':>5}{'inside':>8}{'outside':>8}{'doubted':>8}{'refused':>8}{'in 95 %':>8}{'along':>8}{'total':>8}"
    ]
    groups: dict[str, list[Score]] = defaultdict(list)
    for one in scores:
        groups[one.kind].append(one)
    for one in sorted(scores, key=lambda one: one.seeing_px):
        groups[f"seeing {one.seeing_px:.2f} px"].append(one)
    groups["all"] = scores
    return "\n".join([*lines, *(_line(name, group) for name, group in groups.items())])


def _line(name: str, group: list[Score]) -> str:
    counts = [sum(one.verdict == verdict for one in group) for verdict in ("inside", "outside", "doubted", "refused")]
    share = 100 * counts[0] / max(counts[0] + counts[1], 1)
    ratios = [
        np.array([getattr(one, what) for one in group if one.verdict in ("inside", "outside")])
        for what in ("along", "total")
    ]
    medians = [float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else math.nan for ratio in ratios]
    return (
        f"{name:22}{len(group):5}"
        + "".join(f"{count:8}" for count in counts)
        + f"{share:8.1f}"
        + "".join(f"{median:8.3f}" for median in medians)
    )


def main() -> None:
    """Write logs, or score the product on them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("out", type=Path, nargs="?", help="folder for the logs and truth.json")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--score", type=int, metavar="COUNT", help="write so many and give them to kochab polar")
    parser.add_argument("--kind", choices=KINDS, help="only this kind of the score's logs")
    parser.add_argument(
        "--unsynced", type=float, default=0.0, metavar="DEG", help="one sigma of what the mount's places are off"
    )
    parser.add_argument("--worst", type=int, default=10, help="list so many of the farthest answers")
    asked = parser.parse_args()
    if asked.score is None:
        if asked.out is None:
            parser.error("a folder for the logs, or --score COUNT")
        write_all(asked.out, asked.count, asked.seed)
        return
    with TemporaryDirectory() as folder:
        scores = score_all(asked.out or Path(folder), asked.score, asked.seed, asked.kind, asked.unsynced)
    print(report(scores))
    for one in sorted((one for one in scores if one.verdict != "inside"), key=lambda one: -np.nan_to_num(one.distance))[
        : asked.worst
    ]:
        print(
            f"{one.file} {one.kind:18} {one.seeing_px:.2f} px {one.verdict:8} {one.distance:6.1f} sigma, along {one.along:6.3f}: {one.said}"
        )


def score_all(folder: Path, count: int, seed: int, kind: str | None = None, unsynced_deg: float = 0.0) -> list[Score]:
    """Write the logs of a kind, or of all, into a folder and score each; mounts report places off by one sigma of so much."""
    folder.mkdir(parents=True, exist_ok=True)
    scores, random = [], np.random.default_rng(seed)
    for number, drawn in enumerate(evenings(count, seed)):
        night = replace(drawn, pointing_deg=tuple(random.normal(0, unsynced_deg, 2)))
        if kind in (None, night.kind):
            path = folder / f"PHD2_GuideLog_{number:03d}.txt"
            write_log(night, path)
            scores.append(score(night, path))
    return scores


if __name__ == "__main__":
    main()
