"""Make the sample frames: the shipped catalogue, seen by the project's own simulated cameras.

Run as ``python -m resources.make_samples``; the same catalogue gives the same pictures. Nobody's
photograph is in them, so they carry the project's own licence; the one real photograph lies beside them.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.simulate.star_images import RenderedStar, Sensor, Sky, render
from kochab.sky import open_catalogue

FOLDER = Path(__file__).with_name("samples")
YEAR = 2025.2
_FULL = {False: 16383.0, True: 65535.0}  # 14 bits for pictures, 16 for FITS


@dataclass(frozen=True, slots=True)
class Sample:
    """One frame: where, with what camera, and what it is called.

    ``zero_mag`` is the V magnitude that gives one electron in the exposure.
    """

    file: str
    title: str
    text: str
    ra_deg: float
    dec_deg: float
    roll_deg: float
    width_deg: float
    width: int
    height: int
    zero_mag: float
    sky_e: float
    fwhm_px: float = 2.4
    k1: float = 0.0
    mirrored: bool = False
    colour: bool = False


PHOTOGRAPH = {
    "milky-way.jpg": {
        "title": "The Milky Way in Aquila and Scutum",
        "text": "A real photograph: GranaSAT star tracker, 10 s, 27° wide (MIT)",
    }
}
"""The first sample, not made here: ``README.md`` says where it comes from."""
SAMPLES = (
    Sample(
        "orion.png", "Orion", "50 mm lens on a tripod, mono, 15° wide",
        84.0, -1.5, 12.0, 15.0, 1080, 720, 17.0, 150.0, 2.6,
    ),
    Sample(
        "pleiades.fits", "The Pleiades", "Small refractor, 16-bit camera, 2° wide",
        56.75, 24.12, -28.0, 2.0, 720, 480, 18.6, 300.0, 2.9,
    ),
    Sample(
        "southern-cross.jpg", "The Southern Cross", "Wide lens with distortion, 30° wide",
        190.0, -60.0, 160.0, 30.0, 1500, 1000, 16.2, 120.0, 2.4, -0.04, False, True,
    ),
    Sample(
        "big-dipper.jpg", "The Big Dipper", "Camera turned on its side, 38° wide",
        186.0, 55.5, 74.0, 38.0, 1500, 1000, 15.8, 110.0, 2.3, -0.05, False, True,
    ),
    Sample(
        "kochab-and-polaris.jpg", "Kochab and Polaris",
        "The celestial pole through a star diagonal, mirrored",
        240.0, 82.0, -35.0, 24.0, 1500, 1000, 16.4, 130.0, 2.5, 0.0, True, True,
    ),
)  # fmt: skip


def main() -> None:
    """Write every sample and ``samples.json``."""
    FOLDER.mkdir(exist_ok=True)
    for number, sample in enumerate(SAMPLES):
        _save(sample, _exposure(sample, seed=1000 + number))
    told = PHOTOGRAPH | {s.file: {"title": s.title, "text": s.text} for s in SAMPLES}
    text = json.dumps(told, indent=1, ensure_ascii=False) + "\n"
    (FOLDER / "samples.json").write_text(text, encoding="utf-8", newline="\n")


def camera_of(sample: Sample) -> Camera:
    """The simulated camera."""
    focal = sample.width / 2.0 / np.tan(np.radians(sample.width_deg) / 2.0)
    middle = (sample.width - 1) / 2.0, (sample.height - 1) / 2.0
    return Camera(sample.width, sample.height, focal, *middle, k1=sample.k1, mirrored=sample.mirrored)


def _exposure(sample: Sample, seed: int) -> NDArray[Any]:
    """Linear samples, uint16: (H, W), or (H, W, 3) in colour."""
    catalogue = open_catalogue()
    camera = camera_of(sample)
    attitude = attitude_from(sample.ra_deg, sample.dec_deg, sample.roll_deg)
    faintest = sample.zero_mag - 2.5 * np.log10(60.0)
    reach = np.radians(sample.width_deg) * 0.75
    rows = catalogue.cone(attitude.boresight, reach, float(faintest), year=YEAR)
    xy = camera.project(catalogue.vectors(rows, YEAR) @ attitude.matrix.T)
    margin = 30.0
    with np.errstate(invalid="ignore"):
        near = ((xy > -margin) & (xy < [sample.width + margin, sample.height + margin])).all(axis=1)
    rows, xy = rows[near], xy[near]
    flux = 10.0 ** (0.4 * (sample.zero_mag - catalogue.mag(rows)))
    if not sample.colour:
        return _grey(sample, xy, flux, seed)
    # A star's light in red and blue follows its colour B-V, sunlike at 0.65.
    tint = np.clip(np.nan_to_num(catalogue.bv(rows), nan=0.65), -0.3, 2.0) - 0.65
    bands = (10.0 ** (0.25 * tint), np.ones_like(tint), 10.0 ** (-0.32 * tint))
    skies = (0.9, 1.0, 1.15)
    return np.stack(
        [
            _grey(sample, xy, flux * band, seed * 10 + i, sky)
            for i, (band, sky) in enumerate(zip(bands, skies, strict=True))
        ],
        axis=-1,
    )


def _grey(sample: Sample, xy: NDArray[Any], flux: NDArray[Any], seed: int, sky: float = 1.0) -> NDArray[Any]:
    level = sample.sky_e * sky
    full = _FULL[sample.file.endswith(".fits")]
    return render(
        sample.width, sample.height, xy, flux,
        RenderedStar(sample.fwhm_px, beta=3.0),
        Sky(level, gradient_e=(0.12 * level, 0.3 * level), hot_per_mp=6.0),
        Sensor(gain_e=0.5, read_noise_e=3.0, bias=200.0, saturation=full), seed,
    ).pixels  # fmt: skip


def _save(sample: Sample, linear: NDArray[Any]) -> None:
    path = FOLDER / sample.file
    if path.suffix == ".fits":
        from astropy.io import fits

        header = fits.Header()
        header["DATE-OBS"] = ("2025-01-12T20:14:05", "[UTC] start of exposure")
        header["EXPTIME"] = (30.0, "[s]")
        header["INSTRUME"] = "Kochab simulated camera"
        header["OBJECT"] = "M 45"
        fits.PrimaryHDU(linear, header).writeto(path, overwrite=True)
        return
    from PIL import Image

    # A camera's own 8 bits: the sensor's range through the display's curve.
    share = np.clip((linear.astype(np.float64) - 150.0) / (16383.0 - 150.0), 0.0, 1.0)
    picture = Image.fromarray(np.rint(255.0 * share ** (1 / 2.2)).astype(np.uint8))
    if path.suffix == ".png":
        picture.save(path, optimize=True)
    else:
        picture.save(path, quality=88)


if __name__ == "__main__":
    main()
