"""Files: frames of every format, star lists, catalogues, profiles, settings, sessions and the journal."""

import math
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np

from kochab.core.attitude import attitude_from, unit_vectors
from kochab.core.camera import Camera
from kochab.core.errors import CatalogueError, FrameError, KochabError, UsageError
from kochab.core.frame import Frame, Site
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.frames import read_frame
from tests.frames.files import one_of_each
from tests.fuzz import mutate
from tests.fuzz.target import Target, require, told

HEADER = {
    "OBJECT": "M 42", "RA": "05 35 17.3", "DEC": "-05 23 28", "OBJCTRA": "05 35 17", "FOCALLEN": 250.0, "XPIXSZ": 3.76,
    "XBINNING": 1, "DATE-OBS": "2024-01-15T22:10:11.5", "EXPTIME": 2.5, "SITELAT": 47.5, "SITELONG": "08 32 00",
    "BAYERPAT": "RGGB", "ROWORDER": "BOTTOM-UP", "BZERO": 32768, "BSCALE": 1, "SATURATE": 60000, "GAIN": 1.5,
    "CTYPE1": "RA---TAN", "CTYPE2": "DEC--TAN", "CRVAL1": 83.8, "CRVAL2": -5.4, "CRPIX1": 32.5, "CRPIX2": 24.5,
    "CD1_1": -1e-3, "CD1_2": 0.0, "CD2_1": 0.0, "CD2_2": 1e-3, "INSTRUME": "Camera", "CCD-TEMP": -10.0,
}  # fmt: skip


def _headed(folder: Path) -> None:
    """A FITS file, a JPEG and a TIFF that say much of themselves."""
    from astropy.io import fits
    from PIL import Image

    from tests.frames.files import colours, sky

    hdu = fits.PrimaryHDU(sky())
    hdu.header.update({k: v for k, v in HEADER.items() if k not in ("BZERO", "BSCALE")})
    hdu.writeto(folder / "headed.fits")
    exif = Image.Exif()
    exif[0x010F], exif[0x0110], exif[0x0112], exif[0x0132] = "Canon", "EOS 60Da", 6, "2024:01:15 22:10:11"
    exif.get_ifd(0x8769).update(
        {
            0x829A: 2.5,
            0x920A: 50.0,
            0xA405: 75,
            0xA20E: 2300.0,
            0xA20F: 2300.0,
            0xA210: 3,
            0x9003: "2024:01:15 22:10:11",
        }
    )
    exif.get_ifd(0x8825).update({1: "N", 2: (47.0, 30.0, 0.0), 3: "E", 4: (8.0, 32.0, 0.0), 5: b"\0", 6: 400.0})
    for name in ("headed.jpg", "headed.png", "headed.tif"):
        Image.fromarray(colours()).save(folder / name, exif=exif)


@cache
def good() -> dict[str, bytes]:
    """Small good files of every format by name."""
    with TemporaryDirectory() as folder:
        one_of_each(Path(folder))
        _headed(Path(folder))
        return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


def check_frame(name: str, data: bytes, folder: Path) -> None:
    """A frame in good order, or one sentence that names the file."""
    (path := folder / name).write_bytes(data)
    try:
        frame = read_frame(path)
    except FrameError as error:
        require(name in str(error), f"{error} does not name the file")
        with told(FrameError):
            raise
    else:
        in_order(frame)


def in_order(frame: Frame) -> None:
    """Whether pixels and hints are what everything above the readers takes for granted."""
    pixels, hint = frame.pixels, frame.hint
    require(pixels.ndim == 2 and min(pixels.shape) >= 2 and pixels.dtype.isnative, f"{pixels.shape} {pixels.dtype}")
    require(pixels.flags.c_contiguous and np.isfinite(pixels).all(), "pixels that are not finite")
    require(frame.colour is None or frame.colour.shape == (*pixels.shape, 3), "colour of another size")
    require(frame.bayer in (None, "RGGB", "BGGR", "GRBG", "GBRG"), f"bayer {frame.bayer}")
    require(frame.saturation is None or 0 < frame.saturation < math.inf, f"saturation {frame.saturation}")
    if hint.scale_arcsec_px is not None:
        low, high = hint.scale_arcsec_px
        require(0 < low <= high < math.inf, f"scale {hint.scale_arcsec_px}")
    if hint.centre_deg is not None:
        ra, dec, radius = hint.centre_deg
        require(abs(ra) <= 360 and abs(dec) <= 90 and 0 < radius <= 180, f"centre {hint.centre_deg}")
    if hint.site is not None:
        site = hint.site
        require(abs(site.latitude_deg) <= 90 and abs(site.longitude_deg) <= 360, f"{site}")
        require(math.isfinite(site.height_m), f"{site}")
    require(hint.time_utc is None or hint.time_utc.tzinfo is not None, "a time without a zone")
    require(hint.exposure_s is None or 0 <= hint.exposure_s < math.inf, f"exposure {hint.exposure_s}")
    require(all("\n" not in w and w for w in frame.warnings), f"{frame.warnings}")


def check_kept(data: bytes, folder: Path) -> None:
    """What is read and written is read the same again."""
    from kochab.frames.fits_write import write_fits

    (path := folder / "a.fits").write_bytes(data)
    with told(FrameError):
        frame = read_frame(path)
        write_fits(frame, folder / "again.fits")
        again = read_frame(folder / "again.fits")
        require(np.array_equal(again.pixels, frame.pixels), "other pixels after writing")
        require(again.bayer == frame.bayer and (again.hint.site is None) == (frame.hint.site is None), "another header")
        in_order(again)


SOLUTION = Solution(Camera.centred(64, 48, 800.0), attitude_from(84.0, -2.0, 25.0), (), 0.3, -30.0, "patterns", 40)


def check_solved_copy(data: bytes, folder: Path) -> None:
    """``-update`` changes the WCS and nothing else: the pixels stay as they are, or the file stays whole."""
    from kochab.frames.wcs import write_solved_copy

    (path := folder / "a.fits").write_bytes(data)
    before = _pixels(path)
    done = False
    with told(FrameError):
        write_solved_copy(SOLUTION, path, path)
        done = True
    if not done:
        require(path.read_bytes() == data, "a file that was not updated has changed")
    elif before is not None:
        after = _pixels(path)
        require(after is not None and np.array_equal(after, before), "other pixels after -update")
    require([p.name for p in folder.glob(".*.part")] == [], "a part of a file is left")


def _pixels(path: Path) -> np.ndarray | None:
    try:
        return read_frame(path).pixels
    except FrameError:
        return None


# -- Star lists ---------------------------------------------------------------------------------


def _lists(folder: Path) -> list[bytes]:
    rng = np.random.default_rng(7)
    xy = rng.uniform(0, 600, (12, 2))
    rows = [f"{x:.3f},{y:.3f},{1e4 / (i + 1):.2f}" for i, (x, y) in enumerate(xy)]
    named = ["id;flux;y;x;name", *(f"{i};{9 - i};{y:.2f};{x:.2f};'s {i}'" for i, (x, y) in enumerate(xy[:9]))]
    plain = [f"{x:7.2f} {y:7.2f}" for x, y in xy]
    return ["\n".join(text).encode() for text in (["# stars", "x,y,flux", *rows], named, plain)]


def check_list(data: bytes, folder: Path) -> None:
    from kochab.workflows.solve_frame import read_star_list

    (path := folder / "stars.csv").write_bytes(data)
    with told(UsageError):
        stars = read_star_list(path, 640, 620)
        require(np.isfinite(stars.xy).all() and np.isfinite(stars.flux).all(), "stars at no place")
        require((stars.xy >= -1).all() and (stars.xy <= [640, 620]).all(), "stars outside the frame")
        require(len(np.unique(stars.xy, axis=0)) == len(stars), "a star twice")


# -- Catalogues ---------------------------------------------------------------------------------


def _gaia(folder: Path) -> list[bytes]:
    rng = np.random.default_rng(3)
    head = "source_id,ra,dec,phot_g_mean_mag,bp_rp,pmra,pmdec,ref_epoch"
    rows = [
        f"{i},{rng.uniform(0, 360):.7f},{rng.uniform(-90, 90):.7f},{rng.uniform(3, 14):.4f},{rng.uniform(-0.3, 3):.4f},"
        f"{rng.normal(0, 20):.3f},{rng.normal(0, 20):.3f},2016.0"
        for i in range(12)
    ]
    return ["\n".join(["#a comment", head, *rows]).encode(), "\n".join(["ra,dec,phot_g_mean_mag", "1,2,3"]).encode()]


def _astap(folder: Path) -> list[bytes]:
    rng = np.random.default_rng(5)
    found = []
    for size in (5, 6):
        head = b"Made for a test".ljust(109) + bytes([size])
        mark = bytes([255, 255, 255, 140, 90, 0][:size])
        stars = b"".join(bytes(rng.integers(0, 250, size, dtype=np.uint8)) for _ in range(15))
        found.append(head + mark + stars[: 7 * size] + mark + stars[7 * size :])
    return found


def _index(folder: Path) -> list[bytes]:
    from astropy.io import fits

    rng = np.random.default_rng(6)
    low, span = np.full(3, -1.0), np.array([2147483647.0])
    vector = unit_vectors(rng.uniform(0, 360, 20), rng.uniform(-80, 80, 20))
    stars = np.round((vector - low) * span).astype("<u4")
    columns = {
        "kdtree_range_stars": np.frombuffer(np.concatenate([low, low + 2, span]).astype("<f8").tobytes(), "u1"),
        "kdtree_data_stars": np.frombuffer(stars.tobytes(), "u1"),
    }
    hdus = [fits.PrimaryHDU()]
    for name, data in columns.items():
        rows = data.reshape(-1, 12 if "data" in name else 8)
        hdus.append(fits.BinTableHDU.from_columns([fits.Column(name, f"{rows.shape[1]}B", array=rows)]))
    mags = rng.uniform(4, 12, 20).astype(np.float32)
    hdus.append(fits.BinTableHDU.from_columns([fits.Column("MAG_VT", "E", array=mags)]))
    fits.HDUList(hdus).writeto(path := folder / "index.fits")
    return [path.read_bytes()]


def check_catalogue(name: str, data: bytes, folder: Path) -> None:
    """Stars that are directions with magnitudes, or one sentence."""
    from kochab.sky.catalogue_import import read_foreign

    (path := folder / name).write_bytes(data)
    with told(CatalogueError):
        found = run(read_foreign(path))
        stars = found.stars
        require(np.allclose(np.linalg.norm(stars.vector, axis=1), 1.0, atol=1e-6), "stars that are no directions")
        require(found.epoch is None or math.isfinite(found.epoch), f"epoch {found.epoch}")
        require(np.isfinite(stars.pm).all(), "motions that are not finite")


def _kcat(folder: Path) -> list[bytes]:
    from kochab.sky.catalogue_file import StarList, write_deep

    rng = np.random.default_rng(8)
    stars = StarList.of(unit_vectors(rng.uniform(0, 360, 30), rng.uniform(-80, 80, 30)), rng.uniform(2, 12, 30))
    write_deep(path := folder / "deep.kcat", stars, np.zeros((0, 2), np.int64))
    return [path.read_bytes()]


def check_container(data: bytes, folder: Path) -> None:
    from kochab.sky import open_catalogue
    from kochab.sky.inventory import coverage

    (path := folder / "deep.kcat").write_bytes(data)
    with told(CatalogueError, UsageError):
        catalogue = open_catalogue(path)
        rows = catalogue.cone([1.0, 0.0, 0.0], 1.0)
        require(np.isfinite(catalogue.vectors(rows, 2020.0)).all(), "stars that are no directions")
        run(coverage(catalogue, 30.0, None, 50))


def _manifest(folder: Path) -> list[bytes]:
    from kochab.sky import shipped_folder

    return [(shipped_folder() / "manifest.json").read_bytes()]


def check_manifest(data: bytes, folder: Path) -> None:
    from kochab.sky.catalogue_file import read_manifest

    (folder / "manifest.json").write_bytes(data)
    with told(CatalogueError):
        read_manifest(folder)


# -- What Kochab itself keeps -------------------------------------------------------------------


def _profiles(folder: Path) -> list[bytes]:
    from kochab.core.frame import Site
    from kochab.core.mount import Epoch
    from kochab.gear.profiles import EquipmentProfile, save_profile
    from kochab.gear.session import Meridian

    full = EquipmentProfile(
        "Refraktor", "indi", "host:7624/CCD", 2.0, 100.0, 2, 430.0, 3.76, "cam", "/dev/ttyUSB0", "lx200", 9600,
        Epoch.J2000, Site(47.4, 8.5, 400.0), Meridian.FLIPS, 10.0, 85.0,
    )  # fmt: skip
    return [save_profile(profile).read_bytes() for profile in (full, EquipmentProfile("plain"))]


def check_profile(data: bytes, folder: Path) -> None:
    """A profile that everything can use, or one sentence."""
    from kochab.gear.profiles import load_profile, profile_path, saved_profiles

    (path := profile_path("fuzz")).parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    with told(KochabError):
        profile = load_profile("fuzz")
        for used in (profile.scale_arcsec_px, profile.mount, profile.camera, profile.limits, profile.optics):
            repr(used)
        from kochab.cli.profile import _line
        from kochab.workflows.solution_json import to_line

        to_line(profile.as_json())
        _line(profile).encode("utf-8", "surrogatepass")
        saved_profiles()


def check_horizon(data: bytes, folder: Path) -> None:
    """A horizon whose heights are in order, or one sentence."""
    from kochab.gear.profiles import horizon, read_horizon

    (path := folder / "trees.txt").write_bytes(data)
    with told(UsageError):
        points = np.array(read_horizon(str(path)))
        require(np.isfinite(points).all() and (abs(points[:, 1]) <= 90).all(), f"heights {points}")
        require((np.diff(points[:, 0]) >= 0).all() and (abs(points[:, 0]) <= 360).all(), f"azimuths {points}")
        require(np.array_equal(horizon(points.tolist()), points), "another horizon from its own points")


def _camera_profiles(folder: Path) -> list[bytes]:
    from kochab.solver.camera_profile import new_profile, save_profile

    return [save_profile(new_profile("lens", Camera.centred(640, 480, 2000.0)), folder).read_bytes()]


def _fixed_cameras(folder: Path) -> list[bytes]:
    from kochab.core.attitude import Attitude
    from kochab.core.camera import FisheyeCamera
    from kochab.solver.fixed_camera import FixedCamera, save_fixed_camera

    camera, site = FisheyeCamera.centred(640, 480, 200.0), Site(50.0, 8.0, 100.0)
    terms, free = ("rx", "ry", "rz", "log_focal"), np.array([[90.0, 10.0], [270.0, 20.0]])
    one = FixedCamera(
        "fuzz", site, camera, Attitude(np.eye(3)), terms, 1e-8 * np.eye(4), 0.3, 0.1, 90, 2, 5.0, 0.9, free
    )
    return [save_fixed_camera(one).read_bytes()]


def check_fixed_camera(data: bytes, folder: Path) -> None:
    from kochab.solver.fixed_camera import fixed_camera_path, fixed_cameras, load_fixed_camera

    path = fixed_camera_path("fuzz")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    with told(KochabError):
        camera = load_fixed_camera("fuzz")
        azimuth, altitude, sigma = camera.altaz_deg(camera.middle)
        require(not np.isinf([*azimuth, *altitude, *sigma]).any(), "numbers that no camera has")
        require(np.isfinite(camera.free_from_deg(np.array([10.0]))).all(), "a horizon nowhere")
        require([one.name for one in fixed_cameras()] == [camera.name], "a name that is not listed")


def check_camera_profile(data: bytes, folder: Path) -> None:
    from kochab.solver.camera_profile import load_profile, profile_path, save_profile

    profile_path("lens", 640, 480, folder).write_bytes(data)
    with told(KochabError):
        profile = load_profile("lens", 640, 480, folder)
        require(np.isfinite(list(profile.sigma.values())).all(), f"sigma {profile.sigma}")
        low, high = profile.hint.scale_arcsec_px
        require(0 < low <= high < math.inf, f"scale {low} {high}")
        save_profile(profile, folder)


def _settings(folder: Path) -> list[bytes]:
    return [
        b'[%General]\nangles=sexagesimal\nequipment=\nfolder=/tmp\nsite="47.4,8.5,400"\ntheme=dark\n'
        b"stretch=true\nrecent=/a/b.fits, /c/d.png\n\n[marks]\nnames=false\ngrid=true\n\n"
        b"[mount]\nport=/dev/ttyUSB0\nbaud=9600\nepoch=0\ndriver=lx200\nexposure=2.0\nmeridian=stays\ncamera=folder\n\n"
        b'[live]\n@=x\ntable="{\\"exposure\\": 1.5, \\"gain\\": 3}"\n',
        b'[%General]\nlive="{\\"source\\": \\"indi\\", \\"exposure_s\\": 1.0}"\nlaboratory="{\\"fov\\": 10}"\n'
        b"geometry=@ByteArray(\\x1\\xd9\\xd0\\xcb)\nrecent=@Variant(\\0\\0\\0\\b\\0)\ntext_size=large\n",
    ]


def check_settings(data: bytes, folder: Path) -> None:
    """The window's own: whatever is damaged reads as its default."""
    from PySide6.QtCore import QSettings

    from kochab.gear.profiles import current_profile, keep_profile
    from kochab.window.settings import WindowSettings

    (path := folder / "window.ini").write_bytes(data)
    settings = WindowSettings(QSettings(str(path), QSettings.Format.IniFormat))
    for name in ("stretch", "colour", "mount/after", "recent", "live"):
        settings.flag(name, True)
        settings.text(name, "")
        settings.table(name)
        settings.data(name)
    (settings.angle_style, settings.site, settings.flag("marks/grid", True), settings.recent, settings.as_dict())
    with told(KochabError):
        keep_profile(settings, exposure_s=2.0)
        require(current_profile(settings).exposure_s == 2.0, "a setting was not kept")
    settings.add_recent(path)
    require(settings.recent[0] == path, "the newest file is not the first")


def _sessions(folder: Path) -> list[bytes]:
    import json

    about = {
        "format": 1, "kochab": "1", "source": "folder", "address": "/x", "settings": {"gain": None},
        "solve": {"method": "patterns", "timeout_s": 10.0, "fov_deg": 2.0, "hint": {"scale_arcsec_px": [1.0, 2.0]}},
    }  # fmt: skip
    row = {"frame_file": "frame-000001.fits", "sha256": "0", "time_utc": "2024-01-01T00:00:00+00:00", "solved": True}
    rows = [row | {"ra_deg": 10.0, "dec_deg": 20.0}, row | {"solved": False}]
    return [b"\n".join([json.dumps(about).encode(), *(json.dumps(r).encode() for r in rows)])]


class _NoPointing:
    """An engine for replays that solves nothing."""

    def update(self, frame, moment):
        from kochab.core.solution import NoSolution, Reason
        from kochab.solver.tracker import TrackUpdate

        yield
        return TrackUpdate(moment, "lost", None, NoSolution(Reason.TOO_FEW_STARS, "", "", 0))


def check_session(data: bytes, folder: Path) -> None:
    """A recorded session to be replayed: its description in the first line, its lines after it."""
    from kochab.workflows.live.session import LINES, SESSION, read_session, recorded_options, replay

    about, _, rows = data.partition(b"\n")
    (folder / SESSION).write_bytes(about)
    (folder / LINES).write_bytes(rows)
    (folder / "frame-000001.fits").write_bytes(good()["a.fits"])
    with told(UsageError, FrameError):
        read_session(folder)
        recorded_options(folder)
        for step in replay(folder, _NoPointing()):
            repr(getattr(step, "agrees", None))


def _journals(folder: Path) -> list[bytes]:
    return [
        b"2026-01-01T00:00:00.000Z INFO kochab.gear.journal started: Kochab 1, Python 3\n"
        b"2026-01-01T00:00:01.000Z DEBUG kochab.gear.mounts.serial_line /dev/ttyUSB0 > b':Gt#'\n"
        b"2026-01-01T00:00:01.100Z DEBUG kochab.gear.mounts.serial_line /dev/ttyUSB0 < b'+47*24:00#'\n"
        b"2026-01-01T00:00:02.000Z INFO x solved /home/ann/astro/night.fits site=47.412345 lon: 8.54321\n"
    ]


def check_journal(data: bytes, folder: Path) -> None:
    """A report packs any journal."""
    from kochab.gear.journal import FILE, save_report

    (folder / FILE).write_bytes(data)
    text = data.decode("utf-8", "replace")
    save_report(folder / "report.zip", {"site": "47.412345,8.5", "password": "x", "note": text[:200]}, folder)


def check_typed(data: bytes, folder: Path) -> None:
    """What a person types: angles, sites, addresses, numbers, and lines to the practice night."""
    import argparse

    from kochab.cli import options
    from kochab.gear.servers.address import net_address
    from kochab.parsing.angles import parse_dec_deg, parse_positive, parse_ra_deg, parse_site

    text = data.decode("utf-8", "surrogateescape")
    for parse in (parse_ra_deg, parse_dec_deg, parse_site, partial(parse_positive, what="scale", most=1e4)):
        with told(UsageError):
            repr(parse(text))
    with told(KochabError):
        net_address(text, 11111)
    for read in (options.number, options.site, options._near, options.whole(1, 9), options.between(0, 9, "deg")):
        with suppress(argparse.ArgumentTypeError):
            read(text)


_TYPED = [b"05 35 17.3", b"5h35m17.3s", b"-05:23:28", b"-5d23'28\"", b"83.82", b"47.4,8.5", b"47 24 00 N, 8 30 E, 400",
          b"host:7624/CCD", b"[fe80::1]:11111/0", b"1e3", b"12,-5,3"]  # fmt: skip

_SMALL = mutate.lines(mutate.raw)


def named(*names: str):
    """Seeds that lie in :func:`good`."""
    return lambda folder: [good()[name] for name in names]


def _frames() -> list[Target]:
    rows = [  # name of the file, seeds, mutator, count, quick
        ("a.fits", ("a.fits", "headed.fits"), mutate.fits, 16_000, 15),
        ("a.fits.fz", ("a.fits.fz",), mutate.fits, 4000, 4),
        ("a.fits.gz", ("a.fits.gz",), mutate.zipped(mutate.fits), 4000, 4),
        ("a.xisf", ("a.xisf", "z.xisf"), mutate.xisf, 6000, 5),
        ("a.tif", ("a.tif", "z.tif", "headed.tif"), mutate.raw, 5000, 4),
        ("a.png", ("a.png", "d16.png", "headed.png"), mutate.png, 8000, 8),
        ("a.jpg", ("a.jpg", "headed.jpg"), mutate.raw, 8000, 8),
        ("a.webp", ("a.bmp", "a.gif", "a.webp"), mutate.raw, 4000, 4),
        ("a.heic", ("a.heic",), mutate.raw, 3000, 2),
        ("a.ser", ("a.ser",), mutate.raw, 4000, 4),
        ("a.avi", ("a.avi",), mutate.raw, 4000, 4),
        ("a.dng", ("a.dng",), mutate.raw, 3000, 2),
    ]
    return [
        Target(f"read {name}", named(*seeds), partial(check_frame, name), change, count, quick, sandboxed=name)
        for name, seeds, change, count, quick in rows
    ]


def _text(rng: Random, seeds: mutate.Seeds) -> bytes:
    return mutate.raw(rng, seeds)[:3000]


TARGETS = [
    *_frames(),
    Target("read, write, read", named("a.fits", "headed.fits"), check_kept, mutate.fits, 2000, 2),
    Target("solved copy", named("a.fits", "headed.fits", "a.fits.gz"), check_solved_copy, mutate.fits, 4000, 4),
    Target("star list", _lists, check_list, _SMALL, 15_000, 30),
    Target("Gaia CSV", _gaia, partial(check_catalogue, "gaia.csv"), _SMALL, 8000, 15),
    Target("ASTAP stars", _astap, partial(check_catalogue, "x_0101.290"), mutate.raw, 8000, 15),
    Target("index file", _index, partial(check_catalogue, "index.fits"), mutate.fits, 2000, 2),
    Target("catalogue", _kcat, check_container, mutate.container, 5000, 5),
    Target("manifest", _manifest, check_manifest, mutate.tree, 2000, 5),
    Target("equipment profile", _profiles, check_profile, mutate.tree, 8000, 15),
    Target("horizon", lambda folder: [b"# trees\n0 10\n90.5 25\n180,30\n270 5.5\n"], check_horizon, _SMALL, 6000, 15),
    Target("fixed camera", _fixed_cameras, check_fixed_camera, mutate.tree, 6000, 10),
    Target("camera profile", _camera_profiles, check_camera_profile, mutate.tree, 6000, 10),
    Target("settings", _settings, check_settings, mutate.raw, 4000, 8),
    Target("session", _sessions, check_session, mutate.lines(mutate.tree), 4000, 5),
    Target("journal", _journals, check_journal, _SMALL, 3000, 5),
    Target("typed text", lambda folder: _TYPED, check_typed, _text, 10_000, 30),
]
