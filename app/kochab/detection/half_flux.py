"""Half-flux diameters as ASTAP measures them: what ``-analyse`` and ``-extract`` tell a program that focuses.

The numbers must be ASTAP's, for programs compare them with what they saw last night: the level of the sky from the most
common value, the noise from a sparse grid, stars from three falling thresholds, and a star's diameter from its flux by
distance (Miyashita's approximation, HFD = 2 sum(v r) / sum(v), over an aperture that ends where the star's light does).
Kochab's own detections know nothing of this; their FWHM is another measure.
"""

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.frame import Frame
from kochab.core.robust import mad_sigma, median
from kochab.core.values import frozen

NO_STARS = 99.0
"""What ASTAP tells as the median where there is no star."""
ENOUGH_STARS = 500
RADIUS_PX = 14
"""Of the box in which a star is looked for; the sky is measured on the ring just outside."""
MOST_TRIALS = 60_000
"""Places tried a threshold: a frame that is all bright has no more stars for being searched to its end."""


@frozen
class HalfFluxStar:
    """A star: ``x``, ``y`` px, (0, 0) the centre of the first pixel; ``hfd_px``; ``snr``; ``flux`` above its sky."""

    x: float
    y: float
    hfd_px: float
    snr: float
    flux: float


def counts_16_bit(frame: Frame) -> Floats:
    """The frame (H, W) as ASTAP sees it: in counts of 16 bits, of a colour frame its red."""
    seen = frame.pixels if frame.colour is None else frame.colour[..., 0]
    counts = np.asarray(seen, np.float64)
    if seen.dtype == np.uint8:
        return counts * 257.0
    # Stacks are written as numbers up to 1.
    return counts * 65535.0 if seen.dtype.kind == "f" and np.nanmax(counts) <= 1.5 else counts


def half_flux_stars(pixels: Floats, snr_min: float) -> list[HalfFluxStar]:
    """The stars of a frame by rows, each with its half-flux diameter.

    Parameters
    ----------
    pixels : Floats
        The frame (H, W), in counts of 16 bits: a frame of 8 bits times 257.
    snr_min : float
        The least signal to noise that counts as a star.
    """
    sky, noise, bright = levels(pixels)
    threshold, stars = max(3.5 * noise, bright), []
    for _ in range(3):
        stars = _stars_above(pixels, sky + threshold, snr_min)
        if len(stars) >= ENOUGH_STARS or threshold <= 7.0 * noise:
            break
        threshold = max(6.999 * noise, min(30.0 * noise, threshold * 6.999 / 30.0))
    return stars


def median_hfd_px(stars: list[HalfFluxStar]) -> float:
    """The median half-flux diameter, px; `NO_STARS` without any."""
    ranked = sorted(star.hfd_px for star in stars)
    if not ranked:
        return NO_STARS
    middle = (len(ranked) - 1) // 2
    if len(ranked) % 2 == 0:
        return (ranked[middle] + ranked[middle + 1]) / 2.0
    near = ranked[middle - 1 : middle + 2] if len(ranked) > 3 else [ranked[middle]]
    return sum(near) / len(near)


def levels(pixels: Floats) -> tuple[float, float, float]:
    """Level of the sky, noise, and how far above the sky a thousandth of the pixels lie, counts."""
    counts = np.bincount(np.clip(np.rint(pixels), 0, 65535).astype(np.int64).ravel(), minlength=65536)
    counts[0] = counts[65000:] = 0  # borders that were never exposed, and clipped stars
    total = int(counts.sum())
    mean = round(float(counts @ np.arange(65536)) / (total + 1))
    sky = float(np.argmax(counts[1 : mean + 1]) + 1) if mean else 0.0
    if mean > 1.5 * sky:  # a peak at a clipped foot
        sky = float(mean)
    step = round(pixels.shape[0] / 71)
    step += step % 2 == 0  # an even step would see one colour of a raw frame
    grid = pixels[15 : pixels.shape[0] - 15 : step, 15 : pixels.shape[1] - 15 : step].astype(np.float64)
    off = grid[(grid < 2.0 * sky) & (grid != 0.0)] - sky
    noise, kept = 99999.0, off
    for _ in range(7):
        before, noise = noise, float(np.sqrt(np.mean(kept**2))) if len(kept) else 0.0
        if before - noise < 0.05 * noise:
            break
        kept = off[np.abs(off) <= 3.0 * noise]
    above = np.cumsum(counts[::-1])
    bright = 65535.0 - float(np.searchsorted(above, 0.001 * total, side="right"))
    return sky, noise, max(3.5 * noise, bright - sky - 1.0, 1.0)


def _stars_above(pixels: Floats, level: float, snr_min: float) -> list[HalfFluxStar]:
    """The stars seen from pixels above a level, each once."""
    taken = np.zeros(pixels.shape, np.bool_)
    stars: list[HalfFluxStar] = []
    trials = 0
    for y, x in np.argwhere(pixels > level):
        if taken[y, x]:
            continue
        trials += 1
        if trials > MOST_TRIALS:
            break
        star = _measured(pixels, int(x), int(y))
        if star is None or not (0.8 < star.hfd_px <= 30.0 and star.snr > snr_min):
            continue
        _take(taken, star)
        stars.append(star)
    return stars


def _take(taken: "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]", star: HalfFluxStar) -> None:
    """Leave the star's surroundings to it."""
    radius, x, y = round(3.0 * star.hfd_px), round(star.x), round(star.y)
    rows = np.arange(max(0, y - radius), min(taken.shape[0], y + radius + 1))[:, None]
    columns = np.arange(max(0, x - radius), min(taken.shape[1], x + radius + 1))
    taken[rows, columns] |= (rows - y) ** 2 + (columns - x) ** 2 <= radius**2


_offsets = np.arange(-RADIUS_PX - 1, RADIUS_PX + 2)
_squares = _offsets[:, None] ** 2 + _offsets**2
_RING = (_squares > RADIUS_PX**2) & (_squares <= (RADIUS_PX + 1) ** 2)


def _measured(pixels: Floats, x: int, y: int) -> HalfFluxStar | None:
    """The star around a pixel; None where there is none, or it has no border in the box."""
    height, width = pixels.shape
    reach = RADIUS_PX + 1
    if not (reach < x < width - 1 - reach and reach < y < height - 1 - reach):
        return None
    box = pixels[y - reach : y + reach + 1, x - reach : x + reach + 1].astype(np.float64)
    ring = box[_RING]
    sky = median(ring)
    noise = max(mad_sigma(ring, sky), 1.0)
    found = _centred(box - sky, noise)
    if found is None:
        return None
    radius, dx, dy = found
    centre_x, centre_y = x + dx, y + dy
    if not (radius <= centre_x <= width - 1 - radius and radius <= centre_y <= height - 1 - radius):
        return None
    light, distance = _around(pixels, centre_x, centre_y, radius + 2)
    light = light - sky
    aperture = _aperture(light, distance, noise, radius + 2)
    if aperture is None:
        return None
    inner = slice(radius + 2 - aperture, radius + 3 + aperture)
    light, distance = light[inner, inner], distance[inner, inner]
    flux = max(float(light.sum()), 1e-5)
    hfd = max(0.7, 2.0 * float((light * distance).sum()) / flux)
    return HalfFluxStar(centre_x, centre_y, hfd, flux / float(np.sqrt(flux + np.pi * (aperture * noise) ** 2)), flux)


def _centred(box: Floats, noise: float) -> tuple[int, float, float] | None:
    """Half the side of the box that the star fills to two ninths, and its centre of light from the middle, px."""
    radius, middle = RADIUS_PX, RADIUS_PX + 1
    while True:
        side = slice(middle - radius, middle + radius + 1)
        inside = box[side, side]
        signal = np.where(inside > 3.0 * noise, inside, 0.0)
        total, lit = float(signal.sum()), int(np.count_nonzero(signal))
        if total <= 12.0 * noise or lit <= 1:  # noise, a hot pixel
            return None
        steps = np.arange(-radius, radius + 1)
        dx, dy = float(signal.sum(axis=0) @ steps) / total, float(signal.sum(axis=1) @ steps) / total
        if lit >= 2.0 / 9.0 * (2 * radius + 1) ** 2:
            return radius, dx, dy
        radius -= 2 if radius > 4 else 1  # neighbours fall out of it
        if radius <= 1:
            return radius, dx, dy


def _around(pixels: Floats, x: float, y: float, radius: int) -> tuple[Floats, Floats]:
    """Light at whole steps from a place between pixels, bilinear, 0 beside the frame; and the distances, px."""
    height, width = pixels.shape
    steps = np.arange(-radius, radius + 1)
    column, row = int(np.floor(x)), int(np.floor(y))
    fx, fy = x - column, y - row
    columns, rows = column + steps, row + steps
    near = np.clip(np.arange(rows[0], rows[-1] + 2), 0, height - 1)[:, None]
    patch = pixels[near, np.clip(np.arange(columns[0], columns[-1] + 2), 0, width - 1)].astype(np.float64)
    along = patch[:, :-1] * (1.0 - fx) + patch[:, 1:] * fx
    light = along[:-1] * (1.0 - fy) + along[1:] * fy
    inside = ((rows > 0) & (rows < height - 2))[:, None] & (columns > 0) & (columns < width - 2)
    return np.where(inside, light, 0.0), np.hypot(steps[:, None], steps)


def _aperture(light: Floats, distance: Floats, noise: float, radius: int) -> int | None:
    """Where the star's light ends, px; None when it does not, or when it covers less than a star's disc."""
    rings = np.rint(distance).astype(np.int64)
    lit = np.bincount(rings[(light > 3.0 * noise) & (rings <= radius)], minlength=radius + 1)[: radius + 1]
    most, total, begun = 0, 0, False
    for at, count in enumerate(map(int, lit[:radius])):
        total, most, begun = total + count, max(most, count), begun or count > 0
        if begun and count <= 0.1 * most:
            return None if at > 2 and total < 0.35 * (2 * at - 2) ** 2 else at
    return None
