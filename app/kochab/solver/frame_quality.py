"""Sky brightness, trails and focus of a frame that did not solve."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats
from kochab.core.frame import Detections, Frame
from kochab.core.robust import mad_sigma, median
from kochab.core.values import frozen

SIDE_PX = 1200
"""Frames are binned to about this many pixels a side before shapes are looked at."""

DISC_BINS = (4.0, 5.6)
"""Radii, in bins of each halving of the frame, at which discs are looked for."""
LEAST_DISC_PX = 12.0
CLEAR_DISC_SNR = 15.0
DISCS_ALIKE = 0.12
DUST_SHARE, DUST_SPREAD, OTHER_WIDTHS = 0.4, 0.35, 0.2
MANY_DISCS, FEW_SHARE = 5, 0.2  # three stars are as bright by chance once in four: they must be fainter to be specks
"""A speck takes some per cent of the light, more of a stretched picture; one brightness spans a factor of two or so."""
SLENDER, DIRECTION_DEG, LENGTH = 1.8, 20.0, 1.6
"""Trails are longer than wide by so much, in one direction so nearly, and within so large a factor as long."""
FEWEST_IN_LINES, LINE_EXCESS, LEAST_IN_LINE = 6, 3.0, 1.5
"""Of so many long images each has so many others before and behind it, beyond so many times those by chance."""
FAR_SKY = 5.0
"""Radii of a disc within which the sky is looked at from further away."""


@frozen(eq=False)
class Bins:
    """A frame made small: ``image`` (H, W), finite, the mean of ``step`` by ``step`` pixels."""

    image: Floats
    step: int


@frozen
class FrameLevels:
    """Levels of a frame: ``background_share`` and ``saturated_share`` are fractions of 1.

    ``background_share`` is the median level over the clipping level. ``contrast`` is how far the
    brightest thousandth stands above the median, in units of the noise; 0 in an empty frame.
    ``glare_share`` is the part of the frame that the largest bright patch covers, and
    ``glare_aspect`` that patch's length over its width.
    """

    background_share: float
    saturated_share: float
    contrast: float
    glare_share: float
    glare_aspect: float


@frozen
class Trails:
    """Shapes of the bright patches: ``aspect`` is length over width, 1 when round.

    ``length_px`` is the median length; ``angle_deg`` its direction from +x towards +y in
    [0, 180), NaN when the patches do not agree on one; ``count`` of patches looked at. Trails are alike, all over the
    frame: ``alike`` is the share of patches as long as the median and in its direction, or, without one direction, how
    well neighbours agree on theirs, and ``cover`` the share of the frame's ninths with patches that have long ones.
    ``lined_up``: they are parts of few lines, as letters are, and what a satellite leaves.
    """

    length_px: float = 0.0
    aspect: float = 1.0
    angle_deg: float = float("nan")
    count: int = 0
    alike: float = 1.0
    cover: float = 1.0
    lined_up: bool = False


@frozen
class Discs:
    """Stars out of focus: the ``count`` of discs or rings all as wide, and their median diameter.

    ``share`` is how far the brightest stands above the sky, as a share of the frame's median level; ``spread`` the
    standard deviation of their brightness in its natural logarithm, NaN of one; ``others`` the discs of other widths.
    """

    diameter_px: float = 0.0
    count: int = 0
    share: float = math.inf
    spread: float = math.nan
    others: int = 0

    @property
    def dust(self) -> bool:
        """Whether they are bright specks that a flat of another night left: all faint, and alike or of several widths.

        Stars' light spans more than that of a few shadows: it falls off as a power near -1, whose spread is 1. Specks
        lie at several distances from the sensor; stars are all at one.
        """
        several = self.others > OTHER_WIDTHS * self.count
        faint = self.share < (DUST_SHARE if self.count >= MANY_DISCS else FEW_SHARE)
        return self.count >= 3 and faint and (self.spread < DUST_SPREAD or several)


def binned(frame: Frame) -> Bins:
    """The frame in bins, about SIDE_PX a side, whole colour cells of a mosaic together."""
    step = max(1, round(max(frame.width, frame.height) / SIDE_PX))
    if frame.bayer:
        step = max(2, step + step % 2)
    step = min(step, frame.width, frame.height)
    h, w = frame.height // step, frame.width // step
    rows = np.zeros((h, w * step), dtype=np.float32)
    for i in range(step):  # row by row: no second copy of a large frame
        rows += frame.pixels[i : h * step : step, : w * step]
    small = rows.reshape(h, w, step).sum(axis=2, dtype=np.float64) / step**2
    return Bins(np.nan_to_num(small, nan=0.0, posinf=0.0, neginf=0.0), step)


def measure_light(frame: Frame, bins: Bins) -> FrameLevels:
    """Levels of the frame, whose bins are given."""
    small = bins.image
    level, noise = _level(small)
    top = float(np.quantile(small, 0.999))
    clip = clipping_level(frame)
    # a ninth of the pixels is enough, and an odd step meets all colours of a mosaic
    saturated = float(np.mean(frame.pixels[::3, ::3] >= clip))
    contrast = (top - level) / noise if noise > 0 else 0.0
    share = level / clip if clip > 0 else 0.0
    return FrameLevels(float(np.clip(share, 0, 1)), saturated, contrast, *_glare(small, clip))


def clipping_level(frame: Frame) -> float:
    """The level at which pixels saturate, as far as it is known."""
    whole = frame.pixels.dtype.kind in "iu"
    return frame.saturation or float(np.iinfo(frame.pixels.dtype).max if whole else np.nanmax(frame.pixels))


def measure_discs(bins: Bins, clip: float) -> Discs:
    """Flat discs with a sharp edge, a hole in them or not, as a lens or telescope out of focus makes of stars.

    Seeing and nebulae have no edge, saturated stars are no wider than their brightness makes them; a disc below
    ``clip`` shows the aperture, and all of a frame are as wide.
    """
    from scipy import ndimage

    image, step = bins.image, bins.step
    found: list[_Disc] = []
    sky = median(image)
    # halved again and again: two radii, sqrt 2 apart, are looked for at every size
    while min(image.shape) > 14 * DISC_BINS[-1]:
        for radius in DISC_BINS if 2.0 * DISC_BINS[-1] * step > LEAST_DISC_PX else ():
            # a box inside the disc less one around it: light that is flat within and falls off at an edge stands out
            inner, outer = 2 * round(0.7 * radius) + 1, 2 * round(1.6 * radius) + 1
            light = ndimage.uniform_filter(image, inner) - ndimage.uniform_filter(image, outer)
            peaks = np.argwhere((light == ndimage.maximum_filter(light, 2 * round(radius) + 1)) & (light > 0))
            brightest = np.argsort(-light[tuple(peaks.T)])[:20]
            discs = (_disc(image, place, radius, clip) for place in peaks[brightest].astype(float))
            found += [disc.at_full_scale(step) for disc in discs if disc is not None]
        h, w = (side // 2 for side in image.shape)
        image, step = image[: 2 * h, : 2 * w].reshape(h, 2, w, 2).mean(axis=(1, 3)), 2 * step
    apart: list[_Disc] = []
    for disc in sorted(found, key=lambda disc: -disc.snr):
        # a disc is found at neighbouring sizes, too: the clearest counts
        if all(np.hypot(*(disc.place - there.place)) > there.radius for there in apart):
            apart.append(disc)
    radii, levels = np.array([(disc.radius, disc.level) for disc in apart]).reshape(-1, 2).T
    alike = [abs(radii / radius - 1.0) < DISCS_ALIKE for radius in radii]
    if not alike:
        return Discs()
    widest = max(alike, key=np.count_nonzero)
    own, count = levels[widest], int(np.count_nonzero(widest))
    spread = float(np.std(np.log(own), ddof=1)) if count > 1 else math.nan
    share = float(own.max()) / sky if sky > 0.0 else math.inf
    return Discs(2.0 * float(np.median(radii[widest])), count, share, spread, len(radii) - count)


@frozen(eq=False)
class _Disc:
    """A disc: signal-to-noise ratio, level above the sky, and in bins its radius and its centre (2,) as y, x."""

    snr: float
    level: float
    radius: float
    place: Floats

    def at_full_scale(self, step: int) -> "_Disc":
        return replace(self, radius=self.radius * step, place=self.place * step)


def _disc(image: Floats, place: Floats, radius: float, clip: float) -> _Disc | None:
    """The disc near ``place``; None when it is none."""
    # moved and sized twice by its own light, then judged
    for last in (False, False, True):
        reach, (y, x) = math.ceil(2.0 * radius), np.round(place).astype(int)
        if not (reach <= x < image.shape[1] - reach and reach <= y < image.shape[0] - reach):
            return None
        stamp = image[y - reach : y + reach + 1, x - reach : x + reach + 1]
        dy, dx = np.mgrid[-reach : reach + 1, -reach : reach + 1] + (np.array([y, x]) - place)[:, None, None]
        r = np.hypot(dx, dy) / radius
        around = (r > 1.4) & (r <= 2.0)
        plane = np.stack([np.ones_like(r), dy, dx], axis=-1)
        light = stamp - plane @ np.linalg.lstsq(plane[around], stamp[around], rcond=None)[0]
        light -= np.median(light[around])
        noise = float(np.std(light[around]))
        if last:
            break
        level = float(np.median(light[r < 0.7]))
        if level <= 0.0:
            return None
        core = np.clip(light, 0.0, level) * (r < 1.4)
        # light over level is the disc's area
        wider = math.sqrt(core.sum() / level / math.pi) / radius
        if not 0.6 < wider < 1.3:
            return None
        place = place + np.array([(core * dy).sum(), (core * dx).sum()]) / core.sum()
        radius *= wider
    ring = light[(r >= 0.45) & (r < 0.85)]
    rim = light[(r > 1.2) & (r < 1.5)]
    if not ring.size or not rim.size:
        return None
    level = float(ring.mean())
    if not level > noise or stamp[r < 0.85].max() > 0.95 * clip:
        return None
    beyond = math.ceil(FAR_SKY * radius)
    sky = image[max(y - beyond, 0) : y + beyond + 1, max(x - beyond, 0) : x + beyond + 1]
    if np.median(stamp[r < 0.85]) - np.median(sky) < 0.5 * level:  # the hole in a dust ring is no brighter than the sky
        return None
    rough = math.sqrt(max(0.0, float(ring.var()) - noise**2))
    flat = light[r < 0.45].mean() < 1.25 * level and rough < 0.3 * level
    edge = rim.mean() < 0.15 * level
    # noise averages out over the ring; clouds, whose neighbours go together, do not
    alike = float(np.clip(_shared(light, around) / max(noise**2, 1e-18), 0.0, 0.99))
    snr = level * math.sqrt(ring.size) / max(noise, 1e-9) * (1.0 - alike) / (1.0 + alike)
    return _Disc(snr, level, radius, place) if flat and edge and snr > CLEAR_DISC_SNR else None


def _shared(light: Floats, where: NDArray[np.bool_]) -> float:
    """Covariance of a pixel and its neighbour to the right or below, both where wanted."""
    pairs = [(light[:, 1:], light[:, :-1], where[:, 1:] & where[:, :-1])]
    pairs.append((light[1:], light[:-1], where[1:] & where[:-1]))
    return float(np.mean([np.mean(one[both] * other[both]) for one, other, both in pairs]))


def measure_trails(bins: Bins) -> Trails:
    """Shapes of whatever stands out from the background, vast patches left out."""
    from scipy import ndimage

    small, step = bins.image, bins.step
    small = small - ndimage.uniform_filter(small, max(31, min(small.shape) // 12))
    level, noise = _level(small)
    if noise <= 0:
        return Trails()
    # Where trails fill the frame they are the noise: then the brightest pixels must serve.
    limit = min(level + 5.0 * noise, float(np.quantile(small, 0.985)))
    limit = max(limit, level + 2.0 * noise)
    labels, count = ndimage.label(small > limit, np.ones((3, 3)))
    major, minor, angle, area, place = _moments(labels, count)
    fair = (area >= 6) & (area < 0.03 * small.size)
    largest = np.flatnonzero(fair)[np.argsort(-area[fair])]
    chosen = largest[:60]
    if len(chosen) == 0:
        return Trails()
    # an even bar's variance is a twelfth of its length squared
    length = np.sqrt(12.0 * major[chosen]) * step
    aspect = np.sqrt(major[chosen] / minor[chosen])
    twice = doubled(angle[chosen])
    direction = np.mean(twice)
    agreed = abs(direction) > 0.6
    shown = float(np.degrees(np.angle(direction)) / 2 % 180.0) if agreed else float("nan")
    middle, slender, lined_up = float(np.median(length)), aspect > SLENDER, False
    if agreed:
        lined_up = in_few_lines(place[chosen][slender, ::-1], float(np.radians(shown)), small.shape[::-1])
        near = np.abs(np.angle(twice * np.conj(direction))) < 2.0 * np.radians(DIRECTION_DEG)
        alike = float(np.mean(near & slender & (np.abs(np.log(length / middle)) < np.log(LENGTH))))
    else:
        alike = _neighbours_agree(place[chosen], twice)
    cover = covered(place[chosen][slender], place[largest[:300]], small.shape)
    return Trails(middle, float(np.median(aspect)), shown, len(chosen), alike, cover, lined_up)


def doubled(angle_rad: Floats) -> NDArray[np.complex128]:
    """Directions as numbers of length 1 at twice the angle, for a direction and its opposite are one.

    By sine and cosine: ``np.exp`` of an imaginary number ends the process under Wine, whose C runtime has no ``cexp``.
    """
    return np.asarray(np.cos(2.0 * angle_rad) + 1j * np.sin(2.0 * angle_rad))


def covered(places: Floats, among: Floats, size: tuple[int, ...]) -> float:
    """The share of the frame's ninths with any of ``among`` (N, 2) that have one of ``places`` (M, 2), too.

    It is 0 where those stand in one third of the height or of the width. ``size`` is in the order of the places' axes.
    """
    own, all_ = (np.unique(np.clip(p * 3 // np.array(size), 0, 2), axis=0) for p in (places, among))
    one_strip = len(own) == 0 or bool((own == own[0]).all(axis=0).any())
    return 0.0 if one_strip else len(own) / max(len(all_), 1)


def in_few_lines(places: Floats, angle_rad: float, size: tuple[int, ...], across_px: float = 3.0) -> bool:
    """Whether far more of ``places`` (N, 2), as x, y, follow one another along a direction than stars do by chance.

    Parameters
    ----------
    places : Floats
        Middles of long images (N, 2).
    angle_rad : float
        Their direction, from +x towards +y.
    size : tuple[int, ...]
        Width and height of the frame.
    across_px : float
        So far from a line its parts may be.
    """
    if len(places) < FEWEST_IN_LINES:
        return False
    most = 0.0
    # the mean direction of images is a few degrees off that of the line that they make
    for turn in np.radians(np.arange(-6.0, 6.1, 0.5)):
        across = places @ [np.sin(angle_rad + turn), -np.cos(angle_rad + turn)]
        others = (np.abs(across[:, None] - across) < across_px).sum(axis=1) - 1.0
        breadth = size[0] * abs(np.sin(angle_rad + turn)) + size[1] * abs(np.cos(angle_rad + turn))
        by_chance = (len(places) - 1.0) * 2.0 * across_px / breadth
        most = max(most, float(others.mean()) - LINE_EXCESS * by_chance)
    return most > LEAST_IN_LINE


def _neighbours_agree(places: Floats, twice: NDArray[np.complex128]) -> float:
    """The mean length of the mean of four neighbours' doubled directions: 1 when they agree, 0.4 by chance."""
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    return float(np.abs(twice[np.argsort(apart, axis=1)[:, :4]].mean(axis=1)).mean())


def half_flux_diameter_px(frame: Frame, detections: Detections) -> float:
    """Median over the brightest unsaturated stars of ``2 sum(f r) / sum(f)``, px; NaN without."""
    good = np.flatnonzero(~detections.saturated & ~detections.blended)[:15]
    reach = [4 if not np.isfinite(w) else int(np.clip(2.5 * w, 4, 30)) for w in detections.fwhm_px]
    values = [_hfd(frame, detections.xy[i], reach[i]) for i in good]
    finite = [v for v in values if np.isfinite(v)]
    return float(np.median(finite)) if finite else float("nan")


def _hfd(frame: Frame, xy: Floats, reach: int) -> float:
    x, y = (round(float(c)) for c in xy)
    if not (reach <= x < frame.width - reach and reach <= y < frame.height - reach):
        return float("nan")
    stamp = frame.pixels[y - reach : y + reach + 1, x - reach : x + reach + 1].astype(np.float64)
    rim = np.concatenate([stamp[0], stamp[-1], stamp[:, 0], stamp[:, -1]])
    light = np.clip(stamp - np.median(rim) - 2.0 * np.std(rim), 0.0, None)
    total = light.sum()
    if not total > 0:
        return float("nan")
    axis = np.arange(-reach, reach + 1)
    radius = np.hypot(axis[None, :] + x - xy[0], axis[:, None] + y - xy[1])
    return float(2.0 * (light * radius).sum() / total)


def _level(image: Floats) -> tuple[float, float]:
    """Median and noise; the noise of a quantised dark frame is at least its least step."""
    sample = image[::2, ::2]
    level = median(sample)
    noise = mad_sigma(sample, level)
    if noise == 0.0:
        noise = 0.2 * float(np.std(sample))
    return level, noise


def _glare(small: Floats, clip: float) -> tuple[float, float]:
    """Share of the frame in its largest patch brighter than half the clip, and its aspect."""
    from scipy import ndimage

    labels, count = ndimage.label(small > 0.5 * clip)
    if count == 0:
        return 0.0, 1.0
    major, minor, _, area, _ = _moments(labels, count)
    largest = int(np.argmax(area))
    return float(area[largest] / small.size), float(np.sqrt(major[largest] / minor[largest]))


def _moments(labels: NDArray[np.integer], count: int) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Variances along and across, direction (rad), area and middle (N, 2) as y, x of each labelled patch, bins."""
    y, x = np.nonzero(labels)
    which = labels[y, x] - 1
    area = np.bincount(which, minlength=count).astype(np.float64)

    def mean(values: NDArray[np.float64]) -> Floats:
        return np.asarray(np.bincount(which, values, count) / area)

    place = np.stack([mean(y.astype(float)), mean(x.astype(float))], axis=1)
    dy, dx = y - place[which, 0], x - place[which, 1]
    # a bin is not a point: its own width has a variance of 1/12
    xx, yy, xy = mean(dx * dx) + 1 / 12, mean(dy * dy) + 1 / 12, mean(dx * dy)
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    return middle + half, np.maximum(middle - half, 1 / 12), angle, area, place
