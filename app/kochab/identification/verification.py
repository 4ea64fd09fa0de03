"""Verification of a proposed pointing, and its false-alarm probability."""

import math
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from kochab.core.arrays import Bools, Floats, Ints
from kochab.core.attitude import small_rotation
from kochab.core.pairing import mutual_nearest_of_few
from kochab.core.values import frozen, mutable
from kochab.identification.index import RA_STEPS, Volume, ranges
from kochab.identification.quads import FieldStars, Hypotheses, directions

T = TypeVar("T")

# -- A quick look at many supposed pointings at once, before any is verified in full -----------


def support(volume: Volume, xy: Floats, found: Hypotheses, reach_px: float, first: int = 0) -> Ints:
    """How many of the detections, proposers apart, have a star of the level nearby.

    Stars across RA 0h are missed: it is a quick look.

    Parameters
    ----------
    volume : Volume
        The index that holds the level's stars.
    xy : Floats
        The detections (D, 2), px from the frame's middle.
    found : Hypotheses
        The pointings to try, H of them.
    reach_px : float
        How far is nearby, px.
    first : int
        The number of the first detection in ``xy``, by which the proposers are known.
    """
    d = len(xy)
    p = xy.repeat(len(found), axis=0).reshape(d, len(found), 2).transpose(1, 0, 2).copy()
    p[found.mirrored, :, 0] *= -1.0
    # transposed product: camera to ICRS
    sky = directions(found.focal[:, None], p) @ found.matrix
    hit = _occupied(volume, found.level, sky, (reach_px / found.focal)[:, None])
    proposer = (found.detections[:, :, None] == np.arange(first, first + d)).any(axis=1)
    return np.asarray((hit & ~proposer).sum(axis=1))


def _occupied(volume: Volume, level: Ints, sky: Floats, reach: Floats) -> Bools:
    """Whether a star of its ``level`` (H,) lies within ``reach`` (H, 1) rad of each direction (H, D, 3)."""
    zones = volume.zones[level][:, None]
    z = np.minimum(np.maximum(sky[..., 2], -1.0), 1.0)
    ra = np.arctan2(sky[..., 1], sky[..., 0]) % (2 * np.pi) * (RA_STEPS / (2 * np.pi))
    half = reach * (RA_STEPS / (2 * np.pi)) / np.sqrt(np.maximum(1.0 - z * z, 1e-6))
    left = np.maximum(ra - half, 0.0).astype(np.int64)
    width = np.minimum(ra + half, RA_STEPS - 1).astype(np.int64) + 1 - left
    middle = (np.arcsin(z) / np.pi + 0.5) * zones
    margin = reach * (zones / np.pi)
    low = np.maximum(middle - margin, 0.0).astype(np.int64)
    # few are in two zones: a zone is many times as high as the reach
    across = (np.minimum(middle + margin, zones - 1).astype(np.int64) > low).nonzero()
    number = np.arange(low.size).reshape(low.shape)
    start = np.concatenate([(low * RA_STEPS + left).ravel(), (low * RA_STEPS + left)[across] + RA_STEPS])
    width = np.concatenate([width.ravel(), width[across]])
    asked = np.concatenate([number.ravel(), number[across]])
    edges = np.stack([start, start + width]).astype(np.uint32)
    of = level[asked // max(1, low.shape[1])]
    for one in sorted(set(level.tolist())):
        a, b = volume.offsets[one], volume.offsets[one + 1]
        edges[:, of == one] = volume.keys[a:b].searchsorted(edges[:, of == one]) + a
    count = edges[1].astype(np.int64) - edges[0]
    asked = asked.repeat(count)
    # a zone holds stars far above and below as well
    gap = volume.stars[ranges(edges[0], count)] - sky.reshape(-1, 3)[asked]
    near = np.einsum("ij,ij->i", gap, gap) < (reach * reach).ravel()[asked // max(1, low.shape[1])]
    found = np.zeros(low.size, dtype=bool)
    found[asked[near]] = True
    return found.reshape(low.shape)


# -- How likely chance alone is to give so good an agreement -----------------------------------
# The bound is :func:`log10_agreement`. A fit seeks the best of a continuum: to count its steps of a match radius,
# (reach / r)^d, forgets a factor of about m^(d / 2). Forgetting it claimed down to 10^-6.8 for Orion's likeness in
# Centaurus, in 33 of 792 frames told twice their scale; counted, none claims 10^-3. And since the squares' sum
# counts, matches that fill their radius evenly, as chance gives them, are worth less than places as near as stars'.
#
# Stars do not lie evenly. Where the detections crowd and so do the stars of an open cluster, many
# agree at any pointing that lays the one on the other. So before a pointing is believed, D is
# multiplied by how much denser the stars are where the detections stand (:func:`crowding`). The quads, the
# triangles of a known scale, the last resort of few stars and the published methods are all judged so; a
# tracker's windows hold one star each, and need it not (:mod:`kochab.solver.track_windows`).

ACCEPT_LOG10 = -5.0
"""No pointing is believed that chance would give to one frame in so many, or more often."""

WORTH_COUNTING_LOG10 = -2.0
"""A refused pointing's bound is right down to here, which the bench holds against what it promises."""
NUDGE_RADIUS = 0.01  # over the frame's larger side
NEAR_RADII, FAR_RADII = (1.5, 2.0), (3.0, 4.5, 6.0, 8.0)
NUDGE_DIRECTIONS = 12
"""All stars are nudged by so many radii: too far for a right pointing to agree, yet near."""
OVERLAP = 3.0
"""The near nudges see each star so many times: so many hits are one."""
CLEARLY_DENSER = 4.0
"""Sigmas by which the stars must be denser near by than farther off for that to count."""

_angles = np.arange(NUDGE_DIRECTIONS) * 2.0 * np.pi / NUDGE_DIRECTIONS
NUDGES = np.concatenate([r * np.stack([np.cos(_angles), np.sin(_angles)], axis=1) for r in NEAR_RADII + FAR_RADII])
NEAR = len(NEAR_RADII) * NUDGE_DIRECTIONS  # the first so many


def crowding(seen: Floats, stars: Floats, half: Floats, density: float) -> float:
    """How much denser the stars are where the detections stand than ``density``, at least 1.

    All stars are nudged together in 48 ways, by 3 to 8 radii of a hundredth of the frame's larger side, and those
    within a radius of a detection are counted and compared with stars spread evenly. A cluster laid on a dense blob
    thins out within so many radii: where stars are clearly denser at 1.5 and 2 radii, that is what counts::

        (hits + 1) / (pi r^2 D k + 1),    k the nudged detections that are still inside the frame

    Parameters
    ----------
    seen : Floats
        The detections (n, 2) that are evidence, px from the frame's middle.
    stars : Floats
        Where the catalogue's stars should be (N, 2), likewise.
    half : Floats
        Half the frame's width and height (2,), px.
    density : float
        Stars a square px.
    """
    radius_px = 2.0 * NUDGE_RADIUS * float(half.max())
    # beyond the frame nobody knows the stars
    x, y = seen.T[:, :, None]
    nudge_x, nudge_y = radius_px * NUDGES.T
    inside = (np.abs(x - nudge_x) < half[0]) & (np.abs(y - nudge_y) < half[1])
    x, y = x - stars[:, 0], y - stars[:, 1]
    i, j = (x * x + y * y < ((FAR_RADII[-1] + 1.0) * radius_px) ** 2).nonzero()
    x, y = x[i, j, None] - nudge_x, y[i, j, None] - nudge_y
    hits = ((x * x + y * y < radius_px**2) & inside[i]).sum(axis=0)
    even = inside.sum(axis=0) * (density * math.pi * radius_px**2)
    near, far = float(hits[:NEAR].sum()), float(hits[NEAR:].sum())
    even_near, even_far = float(even[:NEAR].sum()), float(even[NEAR:].sum())
    dense = max(1.0, (far + 1.0) / (even_far + 1.0))  # of few detections one hit proves nothing
    alike = dense * even_near / OVERLAP
    if near / OVERLAP > alike + CLEARLY_DENSER * math.sqrt(alike) + 2.0:
        return (near + 1.0) / (even_near + 1.0)
    return dense


def with_crowding(
    bound: Callable[[float], tuple[float, T]], seen: Floats, stars: Floats, half: Floats, density: float
) -> tuple[float, T]:
    """What ``bound`` says, log10 first, after the stars' :func:`crowding`: every verdict ends here.

    What is likely even without any crowding is left as it is.

    Parameters
    ----------
    bound : Callable[[float], tuple[float, T]]
        Takes the number by which to multiply the density.
    seen : Floats
        The detections (n, 2) that are evidence, px from the frame's middle.
    stars : Floats
        Where the catalogue's stars should be (N, 2), likewise.
    half : Floats
        Half the frame's width and height (2,), px.
    density : float
        Stars a square px.
    """
    even = bound(1.0)
    return even if even[0] > WORTH_COUNTING_LOG10 else bound(crowding(seen, stars, half, density))


def log10_ball(dimensions: int, radius: float) -> float:
    """log10 of the volume of a ball, V(k, R) = pi^(k/2) R^k / Gamma(k/2 + 1)."""
    half = 0.5 * dimensions
    return (half * math.log(math.pi * radius * radius) - math.lgamma(half + 1.0)) / math.log(10.0)


def log10_agreement(
    matched: int, square_px: float, n_evidence: int, density: float, reach_px: float, free: int
) -> float:
    """Bound for one agreement, log10.

    Detections thrown at random among D stars a square px: that m of n have stars at such distances has the density
    C(n, m) D^m in the 2 m coordinates of those distances. A fit of d numbers to them takes away what lies in a
    subspace of d dimensions, in which it moves the stars by at most ``reach`` (RMS), and leaves the sum of squares S.
    So chance gives as good an agreement no oftener than::

        C(n, m) D^m V(d, sqrt(m) reach) V(2 m - d, sqrt(S))

    times the pointings tried and the choices of m; V(k, R) is :func:`log10_ball`.

    Parameters
    ----------
    matched : int
        How many detections matched, the proposers apart.
    square_px : float
        Sum of the squares of their distances, px^2.
    n_evidence : int
        How many could have matched, the proposers apart.
    density : float
        Stars in a square px, times their crowding where it was measured.
    reach_px : float
        Within which each fitted number of the pointing lies.
    free : int
        How many numbers of the pointing were fitted.
    """
    # as many numbers as there are distances can be fitted to any stars
    if 2 * matched <= free:
        return 0.0
    # log C(n, m) by log Gamma: no factorial overflows
    ways = math.lgamma(n_evidence + 1) - math.lgamma(matched + 1) - math.lgamma(n_evidence - matched + 1)
    room = log10_ball(free, math.sqrt(matched) * reach_px)
    rest = log10_ball(2 * matched - free, math.sqrt(square_px) + LEAST_PX)
    return min(0.0, ways / math.log(10.0) + matched * math.log10(density) + room + rest)


def log10_by_distance(
    distances: list[float], n_evidence: int, density: float, tried: tuple[float, float]
) -> tuple[float, int]:
    """Bound for the agreement of few detections that no fit was made to, and how many it counts.

    That m of n lie within r px by chance has at most the probability C(n, m) p^m, p = pi D r^2; the distance of the
    m-th nearest is taken for r, which is as likely to be small as this says, so that only the choice of m, one of n,
    is to be counted::

        min over m of  n C(n, m) (a + b r_m) (pi D r_m^2)^m

    Parameters
    ----------
    distances : list[float]
        Of the detections that have a star near, px, ascending.
    n_evidence : int
        How many detections there are in all.
    density : float
        Stars a square px.
    tried : tuple[float, float]
        The number of pointings whose proposers agree within r px, as a and b of ``a + b r``.
    """
    best, agree, ways = 0.0, 0, 1.0
    for m, distance in enumerate(distances, 1):
        ways *= (n_evidence - m + 1) / m
        value = math.log10(n_evidence * ways * (tried[0] + tried[1] * distance))
        value += m * math.log10(density * math.pi * distance * distance)
        if value < best:
            best, agree = value, m
    return best, agree


FEWEST = 6  # four stars propose, at least two more must agree
LOG10_2 = 0.30103  # two ways of judging, the better counts
LEAST_PX = 1e-6  # lists made up may agree exactly
RADII = 8  # agreement is judged at so many radii, each sqrt 2 apart, the best counts


@mutable(eq=False)
class CandidatePointing:
    """A pointing while it is being improved: ``matrix`` ICRS to camera, focal length in px, k1."""

    matrix: Floats
    focal: float
    mirrored: bool
    k1: float = 0.0

    def project(self, sky: Floats) -> tuple[Floats, Floats]:
        """Pixels (N, 2) from the frame's middle, and tangent-plane points (N, 2)."""
        c = sky @ self.matrix.T
        uv = c[:, :2] / np.maximum(c[:, 2:], 1e-3)
        r2 = (uv * uv).sum(axis=1, keepdims=True)
        # beyond the turning point of a barrel lens the polynomial folds back: keep it monotonic
        bend = np.maximum(1.0 + self.k1 * r2, 0.6)
        xy = self.focal * uv * bend
        xy[c[:, 2] <= 0.05] = 1e9
        if self.mirrored:
            xy[:, 0] = -xy[:, 0]
        return xy, uv


@frozen(eq=False)
class Verdict:
    """What verification found: matched detections and stars (M,), and how likely chance is."""

    pointing: CandidatePointing
    detections: Ints
    stars: Ints
    log10_chance: float
    rms_px: float


def refit(pointing: CandidatePointing, seen: Floats, xy: Floats, uv: Floats, bend: bool) -> CandidatePointing:
    """One Gauss-Newton step on rotation, focal length and, when asked, radial distortion.

    On the tangent plane a turn (x, y, z), a change s of log f and one k of k1 move a star by::

        du = -u v x + (1 + u^2) y - v z + u s + u r^2 k
        dv = -(1 + v^2) x + u v y + u z + v s + v r^2 k,    r^2 = u^2 + v^2

    Parameters
    ----------
    pointing : CandidatePointing
        Where it begins.
    seen : Floats
        The detections (N, 2), px from the frame's middle.
    xy : Floats
        Where the pointing puts the same stars (N, 2), likewise.
    uv : Floats
        The same without focal length and distortion (N, 2), on the tangent plane.
    bend : bool
        Whether radial distortion is fitted too.
    """
    u, v = uv[:, 0], uv[:, 1]
    off = ((seen - xy) / pointing.focal).T.copy()
    if pointing.mirrored:
        off[0] = -off[0]
    one = np.empty((5 if bend else 4, 2, len(u)))  # derivatives of u and of v
    uu, uv_, vv = u * u, u * v, v * v
    # slopes of a lens without distortion: the steps are repeated, and near enough
    one[0, 0], one[0, 1] = -uv_, -1.0 - vv
    one[1, 0], one[1, 1] = 1.0 + uu, uv_
    one[2, 0], one[2, 1] = -v, u
    one[3, 0], one[3, 1] = u, v
    if bend:
        np.multiply(one[3], uu + vv, out=one[4])
    flat = one.reshape(len(one), -1)
    normal = flat @ flat.T
    normal.flat[:: len(one) + 1] *= 1.0 + 1e-9
    try:
        step = np.linalg.solve(normal, flat @ off.ravel()).tolist()
    except np.linalg.LinAlgError:
        return pointing
    turn = small_rotation(np.array([_clipped(s, 0.2) for s in step[:3]]))
    k1 = _clipped(pointing.k1 + step[4], 0.6) if bend else pointing.k1
    focal = pointing.focal * math.exp(_clipped(step[3], 0.2))
    return CandidatePointing(turn @ pointing.matrix, focal, pointing.mirrored, k1)


def _clipped(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def verify(
    volume: Volume,
    level: int,
    view: FieldStars,
    start: CandidatePointing,
    proposers: Ints,
    proposing_stars: Ints,
    reach_px: float,
    use: int,
    accept_log10: float,
) -> Verdict | None:
    """Check one pointing against the brightest detections; None when too few match.

    Proposers are matched and refitted like the others, but neither they count as evidence nor the detections beside
    them, one of which their stars would find in any clump.

    Parameters
    ----------
    volume : Volume
        The index that holds the stars.
    level : int
        Its level for fields of this size.
    view : FieldStars
        The frame's detections, brightest first.
    start : CandidatePointing
        The pointing to check.
    proposers : Ints
        The detections (4,) that suggested it.
    proposing_stars : Ints
        The stars (4,) they would be.
    reach_px : float
        The first, widest radius of a match.
    use : int
        How many of the brightest detections are used.
    accept_log10 : float
        Evidence below it needs no second way of judging, log10.
    """
    seen = view.xy[:use]
    corner = float(np.hypot(*view.half)) + reach_px
    radius = float(np.arctan(corner * 1.05 / start.focal))
    number = volume.near(level, start.matrix[2], min(radius, 1.4))
    sky = volume.stars[number].astype(np.float64)
    # with a margin: stars beyond the edge may come in while the pointing improves
    near = (np.abs(start.project(sky)[0]) < view.half + 3 * reach_px).all(axis=1)
    sky, number = sky[near], number[near]
    pointing = improve(start, seen, sky, reach_px, 5)
    if pointing is None:
        return None
    evidence = np.ones(len(seen), dtype=bool)
    evidence[proposers[proposers < len(seen)]] = False
    own = (number[:, None] == proposing_stars).any(axis=1)
    free = 5 if pointing.k1 else 4
    judged = _agreement(seen, pointing.project(sky)[0], view.half, evidence, own, reach_px, free)
    if judged[0] > accept_log10:
        # fitted to its proposers alone a pointing owes the evidence nothing, so that none of its numbers is free
        four = start
        for _ in range(2):
            at = four.project(volume.stars[proposing_stars].astype(np.float64))
            four = refit(four, view.xy[proposers], *at, bend=False)
        unfitted = _agreement(seen, four.project(sky)[0], view.half, evidence, own, reach_px, free=0)
        if unfitted[0] < judged[0]:
            pointing, judged = four, unfitted
    chance, radius, (i, j, d2) = judged
    agree = d2 < radius * radius
    i, j, d2 = i[agree], j[agree], d2[agree]
    if len(i) < FEWEST:
        return None
    rms = float(np.sqrt(d2.mean()))
    return Verdict(pointing, i, number[j], min(0.0, chance + LOG10_2), rms)


def improve(
    pointing: CandidatePointing, seen: Floats, sky: Floats, radius: float, steps: int
) -> CandidatePointing | None:
    """Pair and refit, the radius shrinking with the residuals; None: it failed.

    Parameters
    ----------
    pointing : CandidatePointing
        Where it begins.
    seen : Floats
        The detections (n, 2), px from the frame's middle.
    sky : Floats
        Stars near the pointing, ICRS unit vectors (N, 3).
    radius : float
        The first radius of a match, px.
    steps : int
        How often at most.
    """
    last = 0
    for step in range(steps):
        xy, uv = pointing.project(sky)
        i, j, d2 = mutual_nearest_of_few(seen, xy, radius)
        if len(i) < (5 if step else FEWEST):
            return None
        pointing = refit(pointing, seen[i], xy[j], uv[j], bend=len(i) >= 10)
        if step:
            middle = float(np.partition(d2, len(d2) // 2)[len(d2) // 2])
            closer = max(0.5 * radius, min(radius, 3.0 * middle**0.5))
            if closer > 0.95 * radius and len(i) == last:
                break  # nothing would change any more
            radius = closer
        last = len(i)
    return pointing


def _agreement(
    seen: Floats, expected: Floats, half: Floats, evidence: Bools, own: Bools, reach_px: float, free: int
) -> tuple[float, float, tuple[Ints, Ints, Floats]]:
    """How unlikely chance makes it that ``seen`` (n, 2) agree so well with ``expected`` (N, 2), log10.

    Both are px from the frame's middle, ``half`` (2,) is half the frame. Also the radius of the least
    likely agreement, px, and the pairs within ``reach_px``, as :func:`mutual_nearest_of_few` gives them.
    Only ``evidence`` (n,) counts, and no star of its ``own`` (N,) that proposed; ``free`` numbers of the
    pointing were fitted to it, none when only the proposers were used.
    """
    pairs = mutual_nearest_of_few(seen, expected, reach_px)
    square = pairs[2][evidence[pairs[0]] & ~own[pairs[1]]]
    return *chance_of(square, seen[evidence], expected, half, reach_px, free), pairs


def chance_of(
    distance2_px: Floats, seen: Floats, expected: Floats, half: Floats, reach_px: float, free: int, candidates: int = 1
) -> tuple[float, float]:
    """log10 of a bound for the chance of so good an agreement with one of ``candidates`` pointings, and its radius.

    Stars count where they crowd as often as they are denser there.

    Parameters
    ----------
    distance2_px : Floats
        Squared distances (M,) of the matches, px^2.
    seen : Floats
        The detections (n, 2) that are evidence, px from the frame's middle.
    expected : Floats
        Where the stars should be (N, 2), likewise.
    half : Floats
        Half the frame's width and height (2,), px.
    reach_px : float
        Largest distance of a match.
    free : int
        How many numbers of the pointing were fitted.
    candidates : int
        How many pointings were compared.
    """
    inside, area = max(1.0, float((np.abs(expected) < half).all(axis=1).sum())), float(4.0 * half[0] * half[1])
    return with_crowding(
        lambda crowd: least_likely(distance2_px, len(seen), crowd * inside, area, reach_px, free, candidates),
        seen,
        expected,
        half,
        inside / area,
    )


def least_likely(
    distance2_px: Floats, n_evidence: int, stars: float, area_px: float, reach_px: float, free: int, candidates: int = 1
) -> tuple[float, float]:
    """The least likely agreement over all radii, log10, and its radius in px.

    Choosing the best of `RADII` radii and of all candidates counts as so many trials (Bonferroni): the bound of
    :func:`log10_agreement` times their number.

    Parameters
    ----------
    distance2_px : Floats
        Squared distances (M,) of the matches, px^2.
    n_evidence : int
        How many detections could have matched.
    stars : float
        How many stars the area holds.
    area_px : float
        The frame's area, px^2.
    reach_px : float
        Largest distance of a match.
    free : int
        How many numbers of the pointing were fitted.
    candidates : int
        How many pointings were compared.
    """
    square = np.sort(distance2_px)
    radii = reach_px / np.sqrt(2.0) ** np.arange(RADII)
    matched, sums = np.searchsorted(square, radii**2).tolist(), np.cumsum(square).tolist()
    trials = math.log10(max(1, candidates) * RADII)
    best, radius, last = 0.0, 0.0, -1
    for m, r in zip(matched[::-1], radii[::-1].tolist(), strict=True):
        if m == last or m == 0:
            continue  # the same agreement within a smaller radius
        last = m
        value = trials + log10_agreement(m, sums[m - 1], n_evidence, stars / area_px, reach_px, free)
        if value < best:
            best, radius = value, r
    return best, radius
