"""Straight streaks of light across a frame: what moved while it was exposed.

The frame is made smaller, its background taken off, and what stands out is put through a Hough transform (Duda and
Hart, 1972, CACM 15, 11). Each line that many bright pixels share is then looked at in the frame itself, piece by piece:
a streak is a ridge that goes on from piece to piece, as narrow as a star, with sky on both sides. Rows of stars, edges
of roofs and clouds, spikes of bright stars and bad columns are none.
"""

import math

import numpy as np

from kochab.core.arrays import Array, Bools, Floats, Indices
from kochab.core.frame import Detections, Frame
from kochab.core.robust import PER_MAD, mad_sigma, median
from kochab.core.values import frozen

FAINT, LONG = 3, 4
"""How much smaller the frame is made, and longer the pieces are, for faint streaks."""
SIDE = 1100
"""px: the longer side of the frame that lines are looked for in, at most."""
BLOCK = 32
"""px of it that share a background."""
BRIGHT = 3.5
"""Times the noise from which a pixel counts."""
MOST_POINTS = 3000
ANGLES = 360
FEWEST_POINTS = 22
"""Pixels that a line needs beyond what it would have by chance."""
TRIES, MOST = 14, 8
"""Lines looked at, and streaks of a frame: more of them are no streaks but structure."""
PIECE_PX, PIECES = 9.0, 160
ACROSS = 14
"""px to each side that a piece's profile reaches."""
SURE_SNR = 4.0
GOES_ON = 0.72
"""Share of a streak's pieces that show it."""
SHORTEST = 14
"""Pieces: a galaxy on its edge is shorter."""
WIDEST, NARROWEST = 3.0, 0.45
"""Times the width of stars."""
BENT = 0.6
"""Times its width that the middle of a streak may stray from a parabola."""
ALONG_PX = 2.5
"""What runs so exactly along rows or columns is of the sensor, or drawn."""
ROUND = 1.5
"""Elongation below which a detection is a star, beside which a piece says nothing."""
PLACE_PX = 0.15
"""No line is known better: its light and the stars' are fitted in different ways."""
EDGE_LEVEL = 0.4
"""Of its height that the sky may differ from one side to the other."""


@frozen(eq=False)
class Streak:
    """From ``ends[0]`` to ``ends[1]`` (2, 2) px, along ``way`` (K, 2) px; ``inside`` says which ends are in the frame.

    ``light`` (K,) is flux a pixel of length along it in the frame's units, ``noise`` (K,) its sigma; ``width_px`` FWHM
    across; ``sigma_px`` how well its place across is known.
    """

    ends: Floats
    inside: tuple[bool, bool]
    way: Floats
    light: Floats
    noise: Floats
    width_px: float
    sigma_px: float

    @property
    def length_px(self) -> float:
        """From end to end."""
        return float(np.hypot(*(self.ends[1] - self.ends[0])))

    @property
    def angle_rad(self) -> float:
        """Direction from +x towards +y, in (-pi/2, pi/2]."""
        dx, dy = self.ends[1] - self.ends[0]
        return math.atan2(dy, dx) if dx > 0 or (dx == 0 and dy > 0) else math.atan2(-dy, -dx)

    @property
    def snr(self) -> float:
        """All its light over its noise."""
        return float(self.light.sum() / math.sqrt(float((self.noise**2).sum())))


def find_streaks(frame: Frame, detections: Detections, stars: Floats) -> list[Streak]:
    """The streaks of a frame, the brightest first; none where everything is one.

    Parameters
    ----------
    frame : Frame
        With its pixels.
    detections : Detections
        Of the frame: their width is that of its stars, and spikes belong to the saturated ones.
    stars : Floats
        Places (N, 2) px of stars that the catalogue has: they are no part of a streak.
    """
    if min(frame.pixels.shape) < 4 * BLOCK:
        return []
    fwhm = median(detections.fwhm_px[np.isfinite(detections.fwhm_px)][:200])
    trailed = median(detections.elongation[np.isfinite(detections.elongation)][:200])
    if not math.isfinite(fwhm) or not trailed < 3.0:
        return []
    first = max(1, -(-max(frame.pixels.shape) // SIDE))
    round_ones = detections.xy[detections.elongation < ROUND]
    found: list[Streak] = []
    # the smaller the frame is made, the fainter a line still stands out, and the less is seen of short ones
    for scale in (first, FAINT * first):
        small = standing_out(_binned(frame.pixels, scale))
        lines = _Lines(_bright(small, stars / scale - 0.5 * (scale - 1) / scale, fwhm / scale), small.shape)
        for _ in range(TRIES):
            line = lines.best()
            if line is None or len(found) > MOST:
                break
            start, normal = line[1] * line[0] * scale + 0.5 * (scale - 1), line[0]
            streak = _looked_at(frame.pixels, start, normal, fwhm, round_ones)
            if streak is None or _is_of_a_star(streak, detections):
                continue
            # what is left of a bright one beside the line that was taken out
            if not any(_same(streak, other) for other in found):
                found.append(streak)
    if len(found) > MOST:
        return []
    return sorted(found, key=lambda one: -one.snr)


def _same(one: Streak, other: Streak) -> bool:
    """Whether two are one streak: one's ends lie on the other."""
    along = (other.ends[1] - other.ends[0]) / max(other.length_px, 1e-9)
    across_px = (one.ends - other.ends[0]) @ np.array([-along[1], along[0]])
    return bool(np.abs(across_px).max() < 2.0 * max(one.width_px, other.width_px))


def _binned(pixels: Array, scale: int) -> Floats:
    """Means of scale x scale pixels; what is left over at the edges is dropped."""
    height, width = (side // scale for side in pixels.shape)
    rows = pixels[: height * scale, : width * scale].reshape(height, scale, width * scale)
    lines = rows.sum(axis=1, dtype=np.float32)
    return np.asarray(lines.reshape(height, width, scale).sum(axis=2) / np.float32(scale * scale), dtype=np.float64)


def standing_out(image: Floats) -> Floats:
    """An image (H, W) over its local background, in its local noise."""
    height, width = image.shape
    rows, columns = max(height // BLOCK, 2), max(width // BLOCK, 2)
    tall, wide = height // rows, width // columns
    blocks = image[: rows * tall, : columns * wide].reshape(rows, tall, columns, wide).swapaxes(1, 2)
    flat = blocks.reshape(rows, columns, -1)
    with np.errstate(invalid="ignore"):
        level = np.median(flat, axis=2)
        noise = PER_MAD * np.median(np.abs(flat - level[:, :, None]), axis=2)
    floor = float(np.median(noise)) * 0.3
    if not floor > 0.0:
        return np.zeros_like(image)
    out = (image - _spread(level, image.shape)) / np.maximum(_spread(noise, image.shape), floor)
    return np.asarray(np.nan_to_num(out, nan=0.0, posinf=0.0, neginf=0.0))


def _spread(grid: Floats, shape: tuple[int, ...]) -> Floats:
    """A grid of blocks interpolated to an image."""
    places = [
        np.clip((np.arange(side) + 0.5) / side * count - 0.5, 0.0, count - 1.0)
        for side, count in zip(shape, grid.shape, strict=True)
    ]
    across = np.stack([np.interp(places[1], np.arange(grid.shape[1]), line) for line in grid])
    low = np.minimum(places[0].astype(np.intp), grid.shape[0] - 2)
    share = (places[0] - low)[:, None]
    return np.asarray(across[low] * (1.0 - share) + across[low + 1] * share)


def _bright(small: Floats, stars: Floats, fwhm: float) -> Floats:
    """Pixels (N, 2) as x, y that stand out and are no star's, the brightest where there are many."""
    mask = small > BRIGHT
    reach = max(1, round(1.5 * fwhm))
    for x, y in np.rint(stars).astype(np.intp):
        mask[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1] = False
    y, x = np.nonzero(mask)
    if len(x) > MOST_POINTS:
        kept = np.argsort(-small[y, x], kind="stable")[:MOST_POINTS]
        y, x = y[kept], x[kept]
    return np.stack([x, y], axis=1).astype(np.float64)


class _Lines:
    """Lines through points (N, 2), the fullest first; what was given is taken out."""

    def __init__(self, points: Floats, shape: tuple[int, ...]) -> None:
        turn = np.arange(ANGLES) * math.pi / ANGLES
        self._normals = np.stack([np.cos(turn), np.sin(turn)])
        self._points, self._shape = points, shape
        self._reach = int(math.hypot(*shape)) + 2
        self._bins = 2 * self._reach + 1
        at = np.rint(points @ self._normals).astype(np.intp) + self._reach
        self._at = at + np.arange(ANGLES) * self._bins
        self._counts = self._counted(self._at)

    def _counted(self, at: Indices) -> Indices:
        return np.bincount(at.ravel(), minlength=ANGLES * self._bins).reshape(ANGLES, self._bins)

    def best(self) -> tuple[Floats, float] | None:
        """Unit normal (2,) and distance from the first pixel of the line most points share beyond chance; or None."""
        if len(self._points) < FEWEST_POINTS:
            return None
        counts = self._counts
        wide = counts.copy()  # a streak is two or three pixels wide, and angles are half a degree apart
        wide[:, 1:] += counts[:, :-1]
        wide[:, :-1] += counts[:, 1:]
        k, best = np.unravel_index(int(np.argmax(wide)), wide.shape)
        # by chance a line of all the frame's length has these
        expected = 3.0 * len(self._points) / math.sqrt(float(self._shape[0] * self._shape[1]))
        if wide[k, best] < FEWEST_POINTS + expected + 4.0 * math.sqrt(expected):
            return None
        first = self._normals[:, k], float(best) - self._reach
        line = _refined(self._points, *first)
        taken = np.abs(self._points @ line[0] - line[1]) < 2.5
        taken |= np.abs(self._points @ first[0] - first[1]) < 1.6
        self._counts = self._counts - self._counted(self._at[taken])
        self._points, self._at = self._points[~taken], self._at[~taken]
        return line


def _refined(points: Floats, normal: Floats, distance: float) -> tuple[Floats, float]:
    """The line through the points near a line."""
    for reach in (4.0, 2.0, 2.0):
        near = points[np.abs(points @ normal - distance) < reach]
        middle = np.median(near, axis=0)
        along = np.array([-normal[1], normal[0]])
        t, off = (near - middle) @ along, (near - middle) @ normal
        if len(near) < 4 or not float(t @ t) > 0.0:
            break
        tilt = float(t @ off) / float(t @ t)
        normal = normal - tilt * along
        normal = normal / np.hypot(*normal)
        distance = float(np.median(near @ normal))
    return normal, distance


def _looked_at(pixels: Array, start: Floats, normal: Floats, fwhm: float, stars: Floats) -> Streak | None:
    """The streak along a line through ``start`` (2,) px with a unit ``normal`` (2,); None where there is none.

    Parameters
    ----------
    pixels : Array
        Of the frame (H, W).
    start : Floats
        A point of the line.
    normal : Floats
        Across it.
    fwhm : float
        Of stars, px.
    stars : Floats
        Places (N, 2) px of what is round.
    """
    along = np.array([-normal[1], normal[0]])
    span = _inside(start, along, pixels.shape)
    if span is None:
        return None
    fine = max(PIECE_PX, (span[1] - span[0]) / PIECES)
    for step in (fine, LONG * fine):
        streak = _in_pieces(pixels, (start, along, normal), span, step, fwhm, stars)
        if streak is not None:
            return streak
    return None


def _in_pieces(
    pixels: Array,
    line: tuple[Floats, Floats, Floats],
    span: tuple[float, float],
    step: float,
    fwhm: float,
    stars: Floats,
) -> Streak | None:
    """As `_looked_at`, in pieces of one length.

    Parameters
    ----------
    pixels : Array
        Of the frame (H, W).
    line : tuple of Floats
        A point of it, and unit vectors along and across.
    span : tuple of float
        From where to where it is in the frame, px from the point.
    step : float
        Length of a piece, px.
    fwhm : float
        Of stars, px.
    stars : Floats
        Places (N, 2) px of what is round.
    """
    start, along, normal = line
    across = max(ACROSS, math.ceil(4.0 * fwhm))
    at = np.arange(span[0] + step / 2.0, span[1], step)
    if len(at) < SHORTEST:
        return None
    offset = np.arange(-across, across + 1)
    profile = _profiles(pixels, start, along, normal, at, offset, step)
    outer = np.abs(offset) > 0.65 * across
    level = np.median(profile[:, outer], axis=1)
    noise = mad_sigma(profile[:, outer] - level[:, None])
    if not noise > 0.0:
        return None
    value = profile - level[:, None]
    core = np.abs(offset) <= max(2, round(0.8 * fwhm))
    light, sigma = value[:, core].sum(axis=1), noise * math.sqrt(core.sum())
    clear = ~_beside(start + at[:, None] * along, stars, step / 2.0 + 1.5 * fwhm)
    # stars on the way make single pieces bright: they neither begin nor end it
    shown = (light > SURE_SNR * sigma) & clear
    run = _longest(shown)
    if run is None:
        return None
    part = slice(run[0], run[1] + 1)
    good = shown[part][clear[part]]
    kept = np.flatnonzero(good) + run[0]
    if len(kept) < SHORTEST or good.mean() < GOES_ON:
        return None
    shape = np.median(value[kept] / light[kept, None], axis=0)
    width = _width(shape, offset)
    sides = float(np.median(shape[offset < -0.65 * across]) - np.median(shape[offset > 0.65 * across]))
    if not NARROWEST * fwhm <= width <= WIDEST * fwhm + 2.0 or abs(sides) > EDGE_LEVEL * float(shape.max()):
        return None
    weight = np.where(core & (value[kept] > 0.0), value[kept], 0.0)
    middle = (weight * offset).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-9)
    bend = np.polynomial.Polynomial.fit(at[kept], middle, 2)
    off = middle - bend(at[kept])
    if mad_sigma(off, 0.0) > max(BENT * width, 0.7):
        return None
    ends_at = at[run[0]] - step / 2.0, at[run[1]] + step / 2.0
    places = start + at[part, None] * along + bend(at[part])[:, None] * normal
    ends = np.array([start + t * along + float(bend(t)) * normal for t in ends_at])
    if np.abs(ends[1] - ends[0]).min() < ALONG_PX:
        return None
    near_edge = 1.5 * step + across
    inside = (bool(ends_at[0] - span[0] > near_edge), bool(span[1] - ends_at[1] > near_edge))
    place_px = max(mad_sigma(off, 0.0) / math.sqrt(len(kept)), PLACE_PX)
    return Streak(ends, inside, places, light[part], np.full(run[1] + 1 - run[0], sigma), width, place_px)


def _beside(places: Floats, stars: Floats, reach: float) -> Bools:
    """Which places (K, 2) have a star (N, 2) within reach, px."""
    from scipy.spatial import cKDTree

    if not len(stars):
        return np.zeros(len(places), dtype=np.bool_)
    return np.asarray(np.isfinite(cKDTree(stars).query(places, distance_upper_bound=reach)[0]))


def _inside(start: Floats, along: Floats, shape: tuple[int, ...]) -> tuple[float, float] | None:
    """Where a line enters and leaves the frame, px from ``start``; None where it misses it."""
    low, high = -math.inf, math.inf
    for k, side in ((0, shape[1]), (1, shape[0])):
        if abs(along[k]) < 1e-9:
            if not 0.0 <= start[k] <= side - 1:
                return None
            continue
        ends = sorted(((0.0 - start[k]) / along[k], (side - 1.0 - start[k]) / along[k]))
        low, high = max(low, ends[0]), min(high, ends[1])
    return (low, high) if high > low else None


def _profiles(
    pixels: Array, start: Floats, along: Floats, normal: Floats, at: Floats, offset: Array, step: float
) -> Floats:
    """Medians along pieces (K, 2A + 1) of the pixels across a line, which single stars and hot pixels do not move.

    Parameters
    ----------
    pixels : Array
        Of the frame (H, W).
    start : Floats
        A point of the line.
    along, normal : Floats
        Unit vectors along and across it.
    at : Floats
        Middles of the pieces (K,), px from ``start``.
    offset : Array
        Places across, px.
    step : float
        Length of a piece, px.
    """
    many = int(min(max(round(step), 5), 40))
    inner = (np.arange(many) + 0.5) / many * step - step / 2.0
    t = (at[:, None] + inner)[:, :, None]
    x = start[0] + t * along[0] + offset * normal[0]
    y = start[1] + t * along[1] + offset * normal[1]
    columns = np.clip(np.rint(x).astype(np.intp), 0, pixels.shape[1] - 1)
    rows = np.clip(np.rint(y).astype(np.intp), 0, pixels.shape[0] - 1)
    return np.asarray(np.median(pixels[rows, columns].astype(np.float64), axis=1))


def _longest(shown: Bools, gap: int = 5) -> tuple[int, int] | None:
    """First and last piece of the longest stretch without so many gaps in a row."""
    at = np.flatnonzero(shown)
    if not len(at):
        return None
    breaks = np.flatnonzero(np.diff(at) > gap)
    firsts, lasts = np.concatenate([[0], breaks + 1]), np.concatenate([breaks, [len(at) - 1]])
    k = int(np.argmax(at[lasts] - at[firsts]))
    return int(at[firsts[k]]), int(at[lasts[k]])


def _width(shape: Floats, offset: Array) -> float:
    """FWHM of a profile, px: how long it stays above half of its height, both flanks interpolated."""
    peak = int(np.argmax(shape))
    half = shape[peak] / 2.0
    if not half > 0.0:
        return 0.0
    right = next((k for k in range(peak, len(shape)) if shape[k] < half), len(shape) - 1)
    left = next((k for k in range(peak, -1, -1) if shape[k] < half), 0)

    def crossing(k: int, inner: int) -> float:
        drop = shape[inner] - shape[k]
        share = (shape[inner] - half) / drop if drop > 0.0 else 0.5
        return float(offset[inner] + share * (offset[k] - offset[inner]))

    return crossing(right, right - 1) - crossing(left, left + 1) if right > left + 1 else 1.0


def _is_of_a_star(streak: Streak, detections: Detections) -> bool:
    """Whether it is a spike or bleeding of a saturated star on it: brightest there, fainter outwards."""
    direction = (streak.ends[1] - streak.ends[0]) / max(streak.length_px, 1e-9)
    normal = np.array([-direction[1], direction[0]])
    bright = detections.xy[detections.saturated & (detections.elongation < ROUND)]  # a flare is saturated itself
    for star in bright:
        t, off = float((star - streak.ends[0]) @ direction), float((star - streak.ends[0]) @ normal)
        if abs(off) > 2.0 * streak.width_px + 2.0 or not -20.0 <= t <= streak.length_px + 20.0:
            continue
        away = np.abs((streak.way - streak.ends[0]) @ direction - t)
        far = float(away.max())
        near, outer = streak.light[(away > 0.1 * far) & (away < 0.4 * far)], streak.light[away > 0.7 * far]
        if len(near) and len(outer) and float(np.median(near)) > 2.0 * max(float(np.median(outer)), 1e-9):
            return True
        if abs(direction).max() > 0.99999:  # along a row or a column: bleeding
            return True
    return False
