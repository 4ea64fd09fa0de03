"""The default detector: any frame, no settings, hot pixels told from stars.

Background and noise on a mesh, local maxima of the smoothed frame, the frame's own star image from the brightest of
them, and a fit of that image to every one. What a single pixel explains better than the star image is a hot pixel.
When the stars are not small, the same is done on the frame made four times smaller, and the clearer result is
taken: far out of focus a star is a ring that at full scale looks like many.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Array, Bools, Floats, Table
from kochab.core.frame import Detections, Frame
from kochab.core.robust import median
from kochab.core.values import frozen
from kochab.detection.background import Halving, Mesh, Smoother, halving, measure_mesh
from kochab.detection.peaks import PreparedFrame, apart, close_pairs, find_peaks, standing_out
from kochab.detection.star_fit import (
    FWHM_PER_SIGMA,
    LARGE_PX,
    PIXEL_VARIANCE,
    adaptive_moments,
    clip_level,
    fit_stars,
    principal_axes,
    refit_bright,
    star_image,
    unweighted,
)

# -- Hot pixels: told from stars, and left out around them -------------------------------------
# A star image explains a star better than any single pixel does: seen through the star image its
# significance exceeds that of its brightest pixel. For a hot pixel it is the other way about, by
# the same factor, so that comparing the two is the test of likelihoods.

REACH = 5  # px: how far a hot pixel may hide a star's peak from the smoothed frame
# px^2: a sharp star; wider ones are even less like a single pixel. Seen through it a single pixel
# has 0.57 of its own significance, and 0.81 among half the pixels; a star of FWHM 1.2 px has 0.98.
QUICK = np.eye(2) * 0.9**2


def quick_look(view: PreparedFrame, xy: Floats, snr: float) -> tuple[Bools, Floats]:
    """Look at the 5 x 5 pixels of peaks (N, 2): which may be stars, and where pixels are hot.

    Returns a mask (N,) and the hot pixels (M, 2), px.
    """
    stamps, _, noise = view.stamps(xy, 2)
    fit = fit_stars(stamps, QUICK, 1)
    flat = stamps.value.reshape(len(xy), -1)
    at = flat.argmax(axis=1)
    peak = np.take_along_axis(flat, at[:, None], axis=1)[:, 0]
    single = fit.snr < (0.8 if view.how.greens is None else 0.92) * peak
    hot = np.flatnonzero(single & (peak > 3.0 * noise))
    places = np.stack([stamps.x[hot] + at[hot] % 5 - 2, stamps.y[hot] + at[hot] // 5 - 2], axis=1)
    return (fit.snr > 0.4 * snr * noise) & ~single, places.astype(np.float64)


def peaks_beside_hot_pixels(view: PreparedFrame, snr: float) -> Floats:
    """Peaks (K, 2) px of 3 x 3 pixels around the view's hot ones, which are left out."""
    if not len(view.hot):
        return np.empty((0, 2))
    stamps, _, noise = view.stamps(view.hot, REACH)
    rows = stamps.value[:, :-2] + stamps.value[:, 1:-1] + stamps.value[:, 2:]
    boxes = rows[:, :, :-2] + rows[:, :, 1:-1] + rows[:, :, 2:]
    side = boxes.shape[1]
    flat = boxes.reshape(len(boxes), -1)
    at = flat.argmax(axis=1)
    high = np.take_along_axis(flat, at[:, None], axis=1)[:, 0] > 3.0 * snr * noise
    offset = np.stack([at % side, at // side], axis=1) - side // 2
    return np.asarray((view.hot + offset)[high])


MIN_SIDE = 8  # px; smaller frames hold no star with a background around it
MAX_PEAKS = 12_000
MIN_COARSE = 128  # px; smaller frames are not made smaller still
COARSE = 4
MOST_LOOKED_AT = 1_500_000  # pixels of stamps in all
BATCH = 500  # stars whose stamps are held at once
MOST_SATURATED = 400  # their stamps are large: the number bounds the time
# Half sizes, px, and the sigma, px, that each is large enough for: nearly all fit into the first, a seventh the work.
SATURATED_STAMPS = ((9, 9 / 4.0), (24, np.inf))
LOOKS = 4  # at a large star, each about where the last one put it: a ring's peaks lie on its rim


@frozen(eq=False)
class MeasuredStars(Table):
    """Measured peaks; arrays of length N, ``moments`` (N, 3) are xx, yy, xy in px^2."""

    xy: Floats
    flux: Floats
    snr: Floats
    moments: Floats
    peak: Floats
    noise: Floats
    saturated: Bools

    def axes(self) -> tuple[Floats, Floats, Floats]:
        """Sigma of the major and minor axis, px, and the major axis' angle, rad."""
        return principal_axes(*self.moments.T)


@frozen
class AutoDetector:
    """Finds stars above ``snr`` and returns ``max_stars`` at most.

    The limit is that for a frame of 1 MP. Noise makes ten times as many peaks in ten times as many
    pixels; the limit goes up and down with them so that it makes less than one star a frame.
    """

    snr: float = 5.5
    max_stars: int = 6000

    def detect(self, frame: Frame) -> Detections:
        """Stars of ``frame``, brightest first."""
        pixels = frame.pixels
        if pixels.ndim != 2 or min(pixels.shape) < MIN_SIDE:
            return nothing(frame)
        found, small = self._at_full_scale(frame)
        if small or min(pixels.shape) < MIN_COARSE:
            return found
        coarse, _ = self._at_full_scale(Frame(_shrunk(pixels)))
        return _enlarged(coarse, frame) if _clearer(coarse, found) else found

    def _at_full_scale(self, frame: Frame) -> tuple[Detections, bool]:
        """Stars up to some 20 px wide or 30 px long, and whether most are small."""
        pixels, how = frame.pixels, halving(frame.bayer)
        mesh = measure_mesh(pixels, how)
        # 0.4 sigma a decade of pixels holds the false peaks of noise below one a frame (class docstring).
        snr = max(self.snr + 0.4 * float(np.log10(pixels.size / 1e6)), 0.85 * self.snr)
        # The smoothing suits no star exactly: a lower line keeps those whose own image later lifts them above snr.
        xy = find_peaks(pixels, how, mesh, 0.85 * snr, MAX_PEAKS)
        if not len(xy):
            return nothing(frame, mesh), True
        likely, hot = quick_look(PreparedFrame(pixels, how, mesh), xy, snr)
        view = PreparedFrame(pixels, how, mesh, hot)
        xy = np.concatenate([xy[likely], peaks_beside_hot_pixels(view, snr)])
        clip = clip_level(view, xy, frame.saturation)
        covariance, small = star_image(view, xy, clip)
        stars = without_duplicates(pixels, measure(view, xy, covariance, clip, snr), covariance)
        found = _detections(frame, mesh, stars, covariance)
        return found.take(slice(self.max_stars)), small


def measure(view: PreparedFrame, xy: Floats, covariance: Floats, clip: float, snr: float) -> MeasuredStars:
    """Stars among the peaks at ``xy`` (N, 2) px, brightest first, hot pixels refused.

    Parameters
    ----------
    view : PreparedFrame
        The frame with its background measured.
    xy : Floats
        Places (N, 2) px of peaks, highest first; of many the highest are measured.
    covariance : Floats
        Second moments (2, 2) px^2 of a star's image on this frame.
    clip : float
        The value from which a pixel is saturated.
    snr : float
        Least signal to noise of a star.
    """
    major = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    half = int(np.clip(np.ceil(2.5 * major) + 1, 4, 16))  # 2.5 sigma hold 96 % of the light
    xy = xy[: MOST_LOOKED_AT // (2 * half + 1) ** 2]  # the highest; large stars need more pixels
    parts = []
    for k in range(0, max(1, len(xy)), BATCH):
        at = places = xy[k : k + BATCH]
        for _ in range(1 if major < LARGE_PX else LOOKS):
            stamps, level, noise = view.stamps(places, half)
            fit = fit_stars(stamps, covariance)
            places = np.stack([stamps.x + fit.dx, stamps.y + fit.dy], axis=1)
        refit_bright(stamps, fit, covariance, np.maximum(level, 10.0 * noise))
        places = np.stack([stamps.x + fit.dx, stamps.y + fit.dy], axis=1)
        peak = stamps.core(2).max(axis=(1, 2)).astype(np.float64)
        stars = MeasuredStars(
            places, fit.flux, fit.snr / noise, unweighted(fit.moments, covariance), peak, noise, peak + level >= clip
        )
        # A fit that wandered off found a neighbour, which has a peak of its own.
        keep = np.hypot(*(places - at).T) < max(3.0, 2.0 * major)
        keep &= (stars.snr > snr) & (stars.snr > peak / noise) & _wide_enough(stars, covariance)
        keep &= (places > -0.5).all(axis=1)
        keep &= (places < np.array(view.pixels.shape[::-1]) - 0.5).all(axis=1)
        parts.append(stars.take(keep))
    stars = MeasuredStars.joined(parts)
    _measure_saturated(stars, view)
    return stars.take(np.argsort(-stars.flux, kind="stable"))


def _wide_enough(stars: MeasuredStars, covariance: Floats) -> Bools:
    """Which are not, beyond doubt, much narrower than the star image: the track of a cosmic ray."""
    narrowest = np.linalg.eigvalsh(covariance)[0] * (0.4 - 1.5 / np.maximum(stars.snr, 4.0))
    return np.asarray(stars.axes()[1] ** 2 > narrowest)


def _measure_saturated(stars: MeasuredStars, view: PreparedFrame) -> None:
    """Saturated stars anew, in place, with a weight as large as their flat tops."""
    left = np.flatnonzero(stars.saturated)[:MOST_SATURATED]
    for half, widest in SATURATED_STAMPS:
        if not len(left):
            return
        stamps, _, _ = view.stamps(stars.xy[left], half)
        shapes = adaptive_moments(stamps, 2.5, 9)
        held = shapes.good & (shapes.axes()[0] < widest)
        good = held & (shapes.flux > stars.flux[left])
        wide = left[good]
        stars.xy[wide] = np.stack([stamps.x + shapes.dx, stamps.y + shapes.dy], axis=1)[good]
        stars.snr[wide] *= shapes.flux[good] / stars.flux[wide]
        stars.flux[wide] = shapes.flux[good]
        stars.moments[wide] = np.stack([shapes.xx, shapes.yy, shapes.xy], axis=1)[good]
        left = left[~held]


def without_duplicates(pixels: Array, stars: MeasuredStars, covariance: Floats) -> MeasuredStars:
    """One detection a star: no doubles, no bumps on a brighter star's light."""
    fwhm = FWHM_PER_SIGMA * float(np.linalg.det(covariance)) ** 0.25
    own = FWHM_PER_SIGMA * stars.axes()[0]
    reach = np.where(stars.saturated, np.maximum(0.7 * own, 0.6 * fwhm), 0.6 * fwhm)
    stars = stars.take(apart(stars.xy, np.maximum(reach, 1.2)))
    reach = np.maximum(2.5 * FWHM_PER_SIGMA * np.minimum(stars.axes()[0], 15.0), 6.0)
    return stars.take(standing_out(pixels, stars.xy, stars.peak, stars.noise, reach))


def _detections(frame: Frame, mesh: Mesh, stars: MeasuredStars, covariance: Floats) -> Detections:
    xx, yy, xy = stars.moments.T  # of the light on the sensor: a pixel's own width is taken off
    major, minor, angle = principal_axes(xx - PIXEL_VARIANCE, yy - PIXEL_VARIANCE, xy)
    # A star in one pixel has no width left once the pixel's own is taken off.
    minor = np.maximum(minor, 0.2)
    major = np.maximum(major, minor)
    # Nearer than two widths of the star image the light of each is in the other's fit.
    blended = np.zeros(len(major), dtype=np.bool_)
    longest = FWHM_PER_SIGMA * float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    for ends in close_pairs(stars.xy, 2.0 * longest):
        blended[ends] = True
    return Detections(
        frame.width,
        frame.height,
        stars.xy,
        stars.flux,
        stars.snr,
        FWHM_PER_SIGMA * np.sqrt(major * minor),
        major / minor,
        angle,
        stars.saturated,
        blended,
        median(mesh.level),
        median(mesh.noise),
    )


def nothing(frame: Frame, mesh: Mesh | None = None) -> Detections:
    """No stars, with the background when it could be measured."""
    empty = Detections.from_list(np.empty((0, 2)), frame.width, frame.height)
    if mesh is None:
        return empty
    return replace(empty, background=median(mesh.level), noise=median(mesh.noise))


def _shrunk(pixels: Array) -> NDArray[np.float32]:
    """Sums of 4 x 4 pixels, in steps of two; what is left over at the edges is dropped."""
    height, width = (side // COARSE for side in pixels.shape)
    out = np.empty((height, width), dtype=np.float32)
    smoother = Smoother(Halving())
    for row in range(0, height, 32):
        part = pixels[COARSE * row : COARSE * min(row + 32, height), : COARSE * width]
        half = smoother.halved(part)
        lines = half[0::2] + half[1::2]
        out[row : row + 32] = lines[:, 0::2] + lines[:, 1::2]
    return out


def _clearer(coarse: Detections, fine: Detections) -> bool:
    """Whether stars stand out more when the frame is made smaller; sharp ones never do.

    Both are measured against the same noise, as the large stars themselves disturb the smaller
    frame's, and a few coarse blobs among many stars do not count.
    """
    top = min(20, len(coarse))
    if top < max(4, min(len(fine), 60) // 4):
        return False
    if not len(fine):
        return True
    # White noise of a sum of 4 x 4 pixels is 4 times a pixel's.
    gain = coarse.noise / (COARSE * fine.noise)
    return bool(median(coarse.snr[:top]) * gain > median(fine.snr[:20]))


def _enlarged(coarse: Detections, frame: Frame) -> Detections:
    """Detections of the shrunk frame in pixels of the frame itself."""
    return replace(
        coarse,
        width=frame.width,
        height=frame.height,
        # Pixel (0, 0) is a centre: the first coarse pixel's middle lies at 1.5 px.
        xy=COARSE * coarse.xy + 0.5 * (COARSE - 1),
        fwhm_px=COARSE * coarse.fwhm_px,
        background=coarse.background / COARSE**2,
        noise=coarse.noise / COARSE,
    )


# -- Single bright pixels as stars, for frames without other stars ------------------------------
# Behind a short lens a star may light one pixel only, as simulated cameras draw it. The default
# detector drops it as a hot pixel; only a match with the catalogue tells the two apart.

MOST = 200
"""A dark frame has thousands of hot pixels; a sky with as many stars has some that are wider."""


def single_pixels(frame: Frame, detector: AutoDetector) -> Detections:
    """The pixels of ``frame`` that ``detector`` takes for hot ones, brightest first."""
    pixels, how = frame.pixels, halving(frame.bayer)
    if pixels.ndim != 2 or min(pixels.shape) < MIN_SIDE:
        return nothing(frame)
    mesh = measure_mesh(pixels, how)
    xy = find_peaks(pixels, how, mesh, 0.85 * detector.snr, 10 * MOST)
    if len(xy):
        _, xy = quick_look(PreparedFrame(pixels, how, mesh), xy, detector.snr)
    at = np.unique(xy.astype(np.intp), axis=0)
    at = at[(at >= 0).all(axis=1) & (at < pixels.shape[::-1]).all(axis=1)]
    level, _ = mesh.at(at[:, 0].astype(np.float64), at[:, 1].astype(np.float64))
    flux = pixels[at[:, 1], at[:, 0]].astype(np.float64) - level
    found = Detections.from_list(at.astype(np.float64), frame.width, frame.height, flux)
    return found.take(slice(MOST))
