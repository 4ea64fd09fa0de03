"""Nights of frames rendered by our own simulator, healthy or with faults planted in them.

What is planted is in the same units as what the night's page says, so that a row of the bench is a difference.
"""

from collections.abc import Iterator
from dataclasses import field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from sgp4.api import WGS72, Satrec
from sgp4.exporter import export_tle

from kochab.core.arrays import Floats
from kochab.core.attitude import cross_product, unit, unit_vectors, wrapped
from kochab.core.frame import Site
from kochab.core.progress import run
from kochab.core.values import frozen
from kochab.frames.fits_write import write_fits
from kochab.simulate import night_sky
from kochab.simulate.camera import CameraConfig
from kochab.simulate.mechanics.axis import GearErrors
from kochab.simulate.mechanics.geometry import MountConfig
from kochab.simulate.rig import SITE, Event, PracticeRig, RigConfig
from kochab.simulate.visitors import Visitor, body_visitor, crossing, fixed_visitor, satellite_visitor, steady
from kochab.sky.apparent import JD_UNIX, of_date_matrix
from kochab.sky.ephemeris import shipped_ephemeris
from kochab.sky.satellites import Satellites, read_satellites
from kochab.sky.small_bodies import shipped_small_bodies
from kochab.sky.solar_system import AU_KM, observer_at

DATE_UNIX = 1_800_000_000.0
BEFORE_MIDNIGHT_S = 4.8 * 3600.0
"""When a night begins: satellites are still in the Sun."""
ASTEROID, ASTEROID_DEG, ASTEROID_MAG = "4 Vesta", (20.29, 1.45), 8.0
"""Where the body is on that night; nights with planted faults point close to it."""
FWHM_PX = 2.8
EXPOSURE_S, EVERY_S = 30.0, 40.0
WORM_S = 2.0 / 15.041 * 3600.0


@frozen
class Faults:
    """What is wrong with a night; the default is nothing.

    ``periodic`` is amplitude in arcsec; ``cloud`` how many magnitudes a bank takes of eight frames; ``slip_arcmin``
    by which the RA clutch gives way; ``asteroid`` whether the field is that of 4 Vesta; ``crossing`` what flies by.
    """

    tilt_px: tuple[float, float] = (0.0, 0.0)
    periodic_arcsec: float = 0.0
    rate_error: float = 0.0
    cloud_mag: float = 0.0
    slip_arcmin: float = 0.0
    dither_px: float = 0.0
    asteroid: bool = False
    crossing: tuple[str, ...] = ()


ALL = Faults(
    tilt_px=(0.5, 0.35),
    periodic_arcsec=14.0,
    rate_error=2e-4,
    cloud_mag=1.1,
    slip_arcmin=9.0,
    dither_px=6.0,
    asteroid=True,
    crossing=("satellite", "unlisted satellite", "meteor", "aircraft", "unknown body", "new star"),
)
CLOUD_FRAMES = 20, 26
SLIP_AFTER = 33
CROSSED = {"satellite": 5, "unlisted satellite": 12, "meteor": 16, "aircraft": 29}
"""In which frame each passes."""
HEIGHT_KM, OLD_S = 1500.0, 3600.0
"""Of the satellite's orbit, and the age of its elements."""
EARTH_KM, GM_KM3_S2, JD_1949_12_31 = 6378.135, 398600.8, 2433281.5
NEW_STAR_MAG, UNKNOWN_BODY_MAG, UNKNOWN_ARCSEC_H = 7.6, 8.0, 500.0


@frozen(eq=False)
class MadeNight:
    """A night on disk, and the two-line elements of what is listed."""

    folder: Path
    files: tuple[str, ...]
    elements: tuple[Satellites, ...]
    site: Site
    places: dict[str, Any] = field(default_factory=dict)


def made_night(folder: Path, seed: int, faults: Faults, frames: int) -> Iterator[int | MadeNight]:
    """Render a night into a folder: yields how many frames are written, the night at last.

    Parameters
    ----------
    folder : Path
        Empty, or to be written over.
    seed : int
        Draws field, noise and dithers.
    faults : Faults
        What is planted.
    frames : int
        How many.
    """
    rng = np.random.default_rng([seed, 36])
    config = night_config(seed, faults, rng)
    rig = PracticeRig(config)
    begin = rig.start_unix
    visitors, elements, places = _visitors(faults, rig, begin, frames)
    rig.camera.visitors = visitors
    scale = rig.camera.optics.scale_arcsec_px
    files = []
    for k in range(frames):
        frame = rig.frame(EXPOSURE_S)
        path = folder / f"light_{k:03d}.fits"
        write_fits(frame, path)
        files.append(str(path))
        rig.clock.sleep(begin + (k + 1) * EVERY_S - rig.clock.now_unix())
        if faults.dither_px and k % 3 == 1:
            east, north = rng.uniform(-1, 1, 2) * faults.dither_px * scale / 3600.0
            rig.mount.turn_by_hand(float(east), float(north))
        yield k + 1
    yield MadeNight(folder, tuple(files), elements, config.site, places)


def night_config(seed: int, faults: Faults, rng: np.random.Generator) -> RigConfig:
    """The rig of a night."""
    start = night_sky.midnight_unix(DATE_UNIX, SITE) - BEFORE_MIDNIGHT_S
    sky = night_sky.LocalSky(SITE, start)
    offset = rng.uniform(-0.4, 0.4, 2)
    centre = unit_vectors(ASTEROID_DEG[0] + float(offset[0]), ASTEROID_DEG[1] + float(offset[1]))
    ra, dec = sky.of_date(centre)
    hour = wrapped(float(np.degrees(sky.sidereal_rad) - ra))
    place = (hour, dec) if faults.asteroid else (float(rng.uniform(-60.0, -20.0)), float(rng.uniform(10.0, 60.0)))
    gear = GearErrors(
        periodic_arcsec=faults.periodic_arcsec,
        worm_phase_deg=float(rng.uniform(0.0, 360.0)),
        rate_error=faults.rate_error,
    )
    bank = ((CLOUD_FRAMES[0] * EVERY_S - 5.0, CLOUD_FRAMES[1] * EVERY_S - 5.0, faults.cloud_mag),)
    slip = Event(SLIP_AFTER * EVERY_S - 1.0, "slip", (faults.slip_arcmin / 60.0, 0.0))
    return RigConfig(
        seed=seed,
        start_unix=start,
        mount=MountConfig(hour_gear=gear),
        camera=CameraConfig(fwhm_px=FWHM_PX, tilt_px=faults.tilt_px, faintest=12.0, zero_point_e_s=1e7),
        weather=night_sky.WeatherConfig(banks=bank if faults.cloud_mag else ()),
        start_deg=place,
        events=(slip,) if faults.slip_arcmin else (),
    )


def _visitors(
    faults: Faults, rig: PracticeRig, begin: float, frames: int
) -> tuple[tuple[Visitor, ...], tuple[Satellites, ...], dict[str, Any]]:
    """What crosses, the elements that are known, and where each is."""
    site, span = rig.config.site, (begin, begin + frames * EVERY_S)
    found: list[Visitor] = []
    known: list[Satellites] = []
    places: dict[str, Any] = {}
    if faults.asteroid:
        table = shipped_small_bodies()
        found.append(body_visitor(table, table.names.index(ASTEROID), site, span, ASTEROID_MAG))

    def centre(k: int) -> tuple[Floats, Floats, Floats]:
        """Boresight, and one degree to the right and down, of frame ``k`` as the field stands at first."""
        attitude = rig.truth(begin).attitude.matrix
        return attitude[2], np.radians(1.0) * attitude[0], np.radians(1.0) * attitude[1]

    def line(
        name: str, k: int, ends: tuple[float, float, float, float], seconds: tuple[float, float], mag: Any
    ) -> None:
        """From ends[:2] to ends[2:], degrees right and down of the centre, between seconds of frame ``k``."""
        middle, right, down = centre(k)
        first, last = (middle + x * right + y * down for x, y in (ends[:2], ends[2:]))
        when = (begin + k * EVERY_S + seconds[0], begin + k * EVERY_S + seconds[1])
        first, last = first / np.linalg.norm(first), last / np.linalg.norm(last)
        found.append(crossing(name, (first, last), when, mag(when)))
        places[name] = {"frame": k, "ends": (first, last)}

    for name in faults.crossing:
        if name == "satellite":
            passing = passing_satellite(rig, begin + CROSSED[name] * EVERY_S, site)
            known.append(passing)
            found.append(satellite_visitor(passing, 0, site, 4.0))
            places[name] = {"frame": CROSSED[name], "name": passing.names[0]}
        elif name == "unlisted satellite":
            line(name, CROSSED[name], (-2.0, 0.9, 2.0, -0.5), (8.0, 13.0), lambda when: steady(4.3))
        elif name == "meteor":
            line(name, CROSSED[name], (-0.5, -0.6, 0.45, 0.2), (10.0, 10.5), _flaring)
        elif name == "aircraft":
            for side in (-0.02, 0.02):
                ends = (-2.0, -0.6 + side, 2.0, -0.1 + side)
                line(name, CROSSED[name], ends, (5.0, 9.0), _blinking if side > 0 else lambda when: steady(3.5))
        elif name == "unknown body":
            middle, right, down = centre(0)
            first = middle + 0.35 * right + 0.2 * down
            turned = np.radians(UNKNOWN_ARCSEC_H * frames * EVERY_S / 3600.0 / 3600.0)
            last = first + turned * (right + 0.4 * down) / np.linalg.norm(right + 0.4 * down)
            way = unit(first), unit(last)
            found.append(crossing(name, way, (span[0], span[1]), steady(UNKNOWN_BODY_MAG)))
            places[name] = {"ends": way}
        elif name == "new star":
            middle, right, down = centre(0)
            there = middle - 0.4 * right + 0.5 * down
            there = there / np.linalg.norm(there)
            found.append(fixed_visitor(name, there, steady(NEW_STAR_MAG)))
            places[name] = {"at": there}
    return tuple(found), tuple(known), places


def _flaring(when: tuple[float, float]) -> Any:
    """V of a meteor: it rises, flares at two thirds and ends."""

    def mag(times: Floats) -> Floats:
        share = np.clip((np.asarray(times) - when[0]) / (when[1] - when[0]), 1e-3, 1.0 - 1e-3)
        light = share**2 * (1.0 - share) / (4.0 / 27.0)
        return np.asarray(0.3 - 2.5 * np.log10(light))

    return mag


def _blinking(when: tuple[float, float]) -> Any:
    """V of a wing's light with a strobe: a twelfth of a second every three quarters of a second."""

    def mag(times: Floats) -> Floats:
        phase = ((np.asarray(times) - when[0]) / 0.4) % 1.0
        return np.where(phase < 0.12, -0.5, 4.0)

    return mag


def passing_satellite(rig: PracticeRig, exposure_from: float, site: Site) -> Satellites:
    """Two-line elements of a satellite that crosses the field during one exposure, high enough to be in the Sun.

    A circular orbit through the point of the line of sight at `HEIGHT_KM`, in a random plane; drawn again until SGP4's
    own perturbations leave it in the field.
    """
    rng = np.random.default_rng([rig.config.seed, 37])
    middle = exposure_from + EXPOSURE_S / 2.0
    observer = observer_at(datetime.fromtimestamp(middle, UTC), site, EXPOSURE_S)
    to_date = of_date_matrix(observer.time_utc)
    sight = to_date @ rig.truth(middle).attitude.matrix[2]
    ground = to_date @ (observer.place - shipped_ephemeris()("earth", observer.jd_tdb))[0] * AU_KM
    radius = EARTH_KM + HEIGHT_KM
    along = float(ground @ sight)
    there = unit(ground + (np.sqrt(along**2 - ground @ ground + radius**2) - along) * sight)
    motion = float(np.sqrt(GM_KM3_S2 / radius**3))
    for number in range(200):
        way = unit(cross_product(there, unit(rng.normal(size=3))))
        pole = cross_product(there, way)
        node = unit(cross_product([0.0, 0.0, 1.0], pole))
        before = float(np.arctan2(cross_product(node, there) @ pole, node @ there)) - motion * OLD_S
        orbit = Satrec()
        epoch = (middle - OLD_S) / 86400.0 + JD_UNIX - JD_1949_12_31
        planes = float(np.arccos(pole[2])), float(np.arctan2(node[1], node[0])) % (2.0 * np.pi)
        orbit.sgp4init(
            WGS72,
            "i",
            40000 + number,
            epoch,
            1e-5,
            0.0,
            0.0,
            1e-4,
            0.0,
            planes[0],
            before % (2.0 * np.pi),
            60.0 * motion,
            planes[1],
        )
        table = read_satellites("made", "\n".join(["KOCHAB TEST", *export_tle(orbit)]))
        if run(table.near(observer, rig.truth(middle).attitude.matrix[2], np.radians(0.5), 99.0)):
            return table
    raise RuntimeError("no satellite passes")
