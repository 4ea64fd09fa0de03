"""The polar axis from drift: frames of a mount that tracked and that nobody turned, or a guide star's path.

A camera fixed to its mount sees the mount's axis in one place: ``R_k^T a`` is the same in every frame, whatever the RA
motor does. One part of it is drift in Dec, the other rotation of the field. Written as ``a = p + e_1 t_1 + e_2 t_2``,
p the pole, it is linear in the two unknowns and needs no small angles. Drift in Dec (TPOINT's MA and ME, Wallace; 3.82
arcmin an arcsec a minute) tells azimuth near the meridian and altitude six hours away. The rest comes from the rotation
of the field, from the bend of the path, and hardly from RA, where periodic error and an inexact rate drift as well.
"""

from collections.abc import Sequence
from dataclasses import field, replace
from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import ARCSEC, angle_between, cross_product, rotation_vectors
from kochab.core.mount import SIDEREAL_RAD_S
from kochab.core.values import frozen
from kochab.polar.error import CHI2_95, Knob, PolarError, angle_in_words, offset_in_words, total_in_words
from kochab.polar.flexure import TUBE_ARCSEC, WORSE, lever, rest_covariance
from kochab.polar.measure import FAR_DEG, MeasureSettings, NoAxis, PolarFinding, PolarFindingKind, stood_still
from kochab.polar.pole import pole_direction
from kochab.polar.rotations import about, tangents, wrapped_rad
from kochab.polar.sighting import LocalAttitude, Sighting, to_local
from kochab.text.translation import tr, tr_noop

FAR_RAD = np.radians(2.0)  # one sigma, each way, of how far an axis stands from its pole before anything is known
ROUNDS, STANDS_ARCSEC = 12, 0.1  # of seeking the axis about where it was found
CREEP_ARCSEC_H = 10.0  # one sigma of what tube and camera bend in an hour, each way, while altitude hardly changes
RATE_ARCSEC_H, PERIODIC_ARCSEC, WORM_S = 30.0, 15.0, 480.0  # of a mount's tracking: clock, and its worm
PULSES = 0.2  # a guide pulse moves Dec by what the calibration says, to this share (one sigma)
POINTING_RAD = np.radians(0.5)  # one sigma of where a mount that nobody synced says that a guide star stands
TILT_RAD = np.radians(1.0)  # one sigma of the angle by which a camera does not look square to its Dec axis (cone)
TURNED_RAD = np.radians(5.0)  # a camera that was turned by more was taken in hand, or flipped by half a turn
LEAK = 0.05  # of a guide star's way in RA that passes for Dec: PHD2's two angles are that far from square
LEAST_S, LONG_S, BLOCKS = 60.0, 600.0, 12
LEAST_SIN = 0.01  # nearer to the axis than half a degree nothing tells Dec from the field's rotation
TOLD_ARCSEC = 120.0
KNOWN_ARCSEC, LONGEST_H, LOWEST_DEG = 30.0, 4.0, 15.0
TRACKED_DEG, GROUP_DEG = 2.0, 1.0
CENTRED_DEG = 5.0  # a flip looks elsewhere by twice what camera and tube are askew
ROLLS_DEG_H = 5.0  # the field of an axis some degrees off turns by less, but very near the pole
JUMP_ARCSEC, JUMP_SIGMAS, JUMPS = 120.0, 6.0, 4.0  # of a jump, and times what the frames turn otherwise
ASKEW = 0.06  # an axis 3 deg off its pole makes so much of a turn in RA or Dec look strange
STEADY_ARCSEC, WANDERS_ARCSEC, FAST_ARCSEC_H = 2.0, 4.0, 60.0


@frozen
class Knock:
    """Between two frames the field turned by ``angle_arcsec`` as neither RA nor Dec turns it."""

    before: str
    after: str
    angle_arcsec: float


@frozen(eq=False)
class Stretch:
    """Attitudes of a mount that tracked one place, by time.

    ``held``: a guider held Dec and RA, so that only the rotation of the field tells; ``ra_held``: RA alone, whose drift
    then says nothing. ``sign_known``: whether north is known from south; ``pier`` is the side of it, for a flip turns
    that round, and ``against_calibration`` that pulses moved the star the other way than the log says. Of a guide star
    ``pulses_rad`` (N,) is how far pulses had moved Dec by then, towards the elevated pole, ``ra_rad`` (N,) how far the
    star stood from its place in RA, and ``steps`` (N,) counts the dithers; its roll means nothing. Stretches of one
    ``calibration`` share the error of their pulses, to ``pulse_share`` (one sigma). A ``knock`` before or after it
    means that the axis no longer stands where it did.
    """

    attitudes: tuple[LocalAttitude, ...]
    held: bool = False
    ra_held: bool = False
    sign_known: bool = True
    against_calibration: bool = False
    pulses_rad: Floats = field(default_factory=lambda: np.zeros(0))
    ra_rad: Floats = field(default_factory=lambda: np.zeros(0))
    steps: Floats = field(default_factory=lambda: np.zeros(0))
    calibration: str = ""
    pulse_share: float = PULSES
    pier: str = ""
    knock: Knock | None = None

    @property
    def seconds(self) -> Floats:
        """Time of each, from the first."""
        return np.array([(a.time_utc - self.attitudes[0].time_utc).total_seconds() for a in self.attitudes])


@frozen(eq=False)
class Drift:
    """The axis by drift. ``minutes_more`` on the same place make it known to 30 arcsec; None: not within hours.

    ``otherwise`` is the error where north and south in Dec change places, when nothing tells which is which.
    """

    error: PolarError
    settings: MeasureSettings
    stretches: tuple[Stretch, ...]
    minutes_more: float | None
    findings: tuple[PolarFinding, ...] = ()
    otherwise: PolarError | None = None

    @property
    def spoilt(self) -> bool:
        """Whether no bolt is to be turned after it."""
        return any(finding.spoils for finding in self.findings)

    @property
    def unsettled(self) -> bool:
        """Whether it is good, but rests on what nothing bears out."""
        return not self.spoilt and any(finding.unsettled for finding in self.findings)

    def tells(self, knob: Knob) -> bool:
        """Whether this bolt is known: to 2 arcmin, or to half of its error."""
        sigma = self.error.with_systematics.knob_sigma_arcsec(knob)
        return sigma < max(TOLD_ARCSEC, 0.5 * abs(self.error.knob_arcsec(knob)))

    @property
    def known(self) -> bool:
        """Whether both bolts are."""
        return self.tells(Knob.ALTITUDE) and self.tells(Knob.AZIMUTH)

    @property
    def minutes(self) -> float:
        """How long was tracked, all stretches."""
        return sum(float(s.seconds[-1]) for s in self.stretches) / 60.0

    @property
    def at_least_arcsec(self) -> float:
        """The error along the ellipse's short axis: what is known even where the long one is very long."""
        _, _, angle = self.error.ellipse_arcsec()
        across = np.array([np.cos(angle), -np.sin(angle)])  # of (altitude, azimuth), where the long one is (sin, cos)
        return abs(float(across @ [self.error.altitude_arcsec, self.error.azimuth_on_sky_arcsec]))

    @property
    def time_utc(self) -> datetime:
        """Of the last frame."""
        return max(s.attitudes[-1].time_utc for s in self.stretches)

    @property
    def words(self) -> str:
        """How far the axis is from the pole, with one sigma, or at least."""
        at_least = tr("at least {angle}", angle=angle_in_words(self.at_least_arcsec))
        return total_in_words(self.error) if self.known else at_least

    def unknown(self, knob: Knob) -> str:
        """That a bolt is not known, and how far it may be off."""
        return tr(
            "not known yet (± {angle})", angle=angle_in_words(self.error.with_systematics.knob_sigma_arcsec(knob))
        )

    @property
    def where(self) -> str:
        """Where the axis stands, of the bolts that are known."""
        known = [offset_in_words(self.error, knob) for knob in Knob if self.tells(knob)]
        return ", ".join(known) or tr("at least {angle}", angle=angle_in_words(self.at_least_arcsec))

    @property
    def better(self) -> str:
        """What would make the axis better known; empty when it is good."""
        if self.minutes_more is None:
            return tr("Track another place in the sky: here it would take hours.")
        more = tr("Track {minutes:.0f} min more on this place for an uncertainty of 30″.", minutes=self.minutes_more)
        return more if self.minutes_more else ""


def tracked(sightings: Sequence[Sighting]) -> bool:
    """Whether all frames show one place in the sky, over more than a minute: a mount that only tracked.

    It may have flipped, or somebody turned the camera, where frames go on as those before them for minutes.
    """
    if len(sightings) < 2:
        return False
    ordered = sorted(sightings, key=lambda s: s.time_utc)
    first = sightings[0].attitude.matrix
    turns = [[angle_between(*axes) for axes in zip(s.attitude.matrix, first, strict=True)] for s in sightings]
    if (ordered[-1].time_utc - ordered[0].time_utc).total_seconds() < LEAST_S:
        return False
    most, there = np.max(turns), np.max([turn[2] for turn in turns])
    going_on_s = sum((b.time_utc - a.time_utc).total_seconds() for a, b in pairwise(ordered) if _goes_on(a, b))
    return bool(most < np.radians(TRACKED_DEG) or (there < np.radians(CENTRED_DEG) and going_on_s > LONG_S))


def stretches_of(sightings: Sequence[Sighting], settings: MeasureSettings, guided: bool | None) -> list[Stretch]:
    """Frames by time, parted where the mount went elsewhere, flipped or was knocked, or the camera was turned.

    ``guided`` None judges by how they wander.
    """
    groups: list[list[Sighting]] = []
    for one in sorted(sightings, key=lambda s: s.time_utc):
        if groups and _goes_on(groups[-1][-1], one):
            groups[-1].append(one)
        else:
            groups.append([one])
    found: list[Stretch] = []
    for group in groups:
        jumps = _jumps(group)
        for begin, end in pairwise([0, *jumps, len(group)]):
            part, knock = group[begin:end], jumps.get(begin)
            if (part[-1].time_utc - part[0].time_utc).total_seconds() >= LEAST_S:
                local = tuple(to_local(s, settings.site, settings.refraction) for s in part)
                found.append(Stretch(local, _holds(part) if guided is None else guided, knock=knock))
            elif knock and found:  # too short to drift, but it shows that the axis is not where it was
                found[-1] = replace(found[-1], knock=knock)
    return found


def _goes_on(before: Sighting, after: Sighting) -> bool:
    """Whether the camera looks where it looked, and is rolled as it was but for the rotation of the field."""
    hours = (after.time_utc - before.time_utc).total_seconds() / 3600.0
    apart = [angle_between(*axes) for axes in zip(after.attitude.matrix, before.attitude.matrix, strict=True)]
    return bool(apart[2] < np.radians(GROUP_DEG) and max(apart) < np.radians(GROUP_DEG + ROLLS_DEG_H * hours))


def _jumps(group: Sequence[Sighting]) -> dict[int, Knock | None]:
    """The frames before which the camera turned by far more than between others: put elsewhere a little, or knocked.

    RA and Dec turn it about the axis and across it; what is left over, no motor does.
    """
    if len(group) < 3:
        return {}
    matrices = np.stack([s.attitude.matrix for s in group])
    turns = rotation_vectors(matrices[1:] @ np.swapaxes(matrices[:-1], 1, 2))
    pole = matrices[:-1, :, 2]  # in the camera; near enough to the axis
    aside = np.array([0.0, 0.0, 1.0]) - pole[:, 2:] * pole
    strange = np.einsum("ki,ki->k", turns, aside / np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-6))
    hours = np.array([(b.time_utc - a.time_utc).total_seconds() / 3600.0 for a, b in pairwise(group)])
    known = [s.attitude.covariance for s in group if s.attitude.covariance is not None]
    least = max(JUMP_ARCSEC * ARCSEC, JUMP_SIGMAS * float(np.sqrt(2.0 * np.median([np.trace(c) for c in known]))))
    size = np.linalg.norm(turns, axis=1)
    usual = np.median(size / np.maximum(hours, 1e-6)) * hours
    strange = np.abs(strange - np.median(strange / np.maximum(hours, 1e-6)) * hours)
    found: dict[int, Knock | None] = {}
    for k in map(int, np.flatnonzero((size > least + JUMPS * usual) | (strange > least))):
        knocked = strange[k] > least + ASKEW * size[k]
        names = group[k].label or tr("one frame"), group[k + 1].label or tr("the next")
        found[k + 1] = Knock(*names, float(strange[k]) / ARCSEC) if knocked else None
    return found


def _holds(group: Sequence[Sighting]) -> bool:
    """Whether a guider may have held these frames: RA never wanders as a worm does, or Dec jumps (dithers)."""
    places = np.stack([s.attitude.matrix[2] for s in group])
    hours = np.array([(s.time_utc - group[0].time_utc).total_seconds() for s in group]) / 3600.0
    dec = np.arcsin(places[:, 2]) / ARCSEC
    ra = np.unwrap(np.arctan2(places[:, 1], places[:, 0])) / ARCSEC * np.cos(dec.mean() * ARCSEC)
    if len(group) < 4:
        return True
    scatter, rate = [], []
    for path in (ra, dec):
        line = np.polyfit(hours, path, 1)
        scatter.append(float(np.std(path - np.polyval(line, hours), ddof=2)))
        rate.append(abs(float(line[0])))
    steady = max(STEADY_ARCSEC, 3.0 * float(np.sqrt(_variance_arcsec2(group))))
    wanders = scatter[0] > max(WANDERS_ARCSEC, steady) or max(rate) > FAST_ARCSEC_H
    # Not guided only where Dec keeps to a line and RA wanders: held Dec must never pass for an axis without drift.
    return not (scatter[1] < steady and wanders)


def _variance_arcsec2(group: Sequence[Sighting]) -> float:
    """Median variance of the frames' pointing, each way, arcsec^2."""
    known = [s.attitude.covariance for s in group if s.attitude.covariance is not None]
    return float(np.median([np.trace(c[:2, :2]) / 2.0 for c in known])) / ARCSEC**2


def measure_drift(stretches: Sequence[Stretch], settings: MeasureSettings) -> Drift | NoAxis:
    """The axis that one stretch of tracking or more show together, with its error from the pole."""
    used = tuple(s for s in stretches if len(s.attitudes) >= 2 and s.seconds[-1] >= LEAST_S)
    if not used:
        return NoAxis(
            tr("Drift needs frames over more than a minute of tracking"), tr("Track one place for 10 minutes or more.")
        )
    if still := next(filter(None, (stood_still(s.attitudes) for s in used)), None):
        return still
    towards = pole_direction(settings.site, settings.pole, settings.refraction)
    lowest = min(a.altitude_deg for s in used for a in s.attitudes)
    if lowest < 0.0:
        return NoAxis(
            tr("The frames would be below the horizon"),
            tr("Check the site and the time."),
            PolarFindingKind.SITE_OR_TIME,
        )
    # First with the stated errors, which tells how much larger they are; then with those.
    found, wider = _converged(used, towards, towards, 1.0, FAR_RAD**2 * np.eye(2))
    found, _ = _converged(used, towards, found.axis, wider, found.covariance)
    error = found.error
    minutes = _minutes_more(used, found, wider)
    doubts = [*_doubts(used, wider, found), *_findings(used, error, lowest)]
    return Drift(error, settings, used, minutes, tuple(doubts))


# -- Linear least squares: two numbers of the axis, the tube's droop, and what each stretch has of its own -----------


@frozen(eq=False)
class _Solved:
    """An axis, and its covariances (2, 2), rad^2."""

    axis: Floats
    pole: Floats
    noise: Floats
    covariance: Floats

    @property
    def error(self) -> PolarError:
        return PolarError(self.axis, self.pole, self.noise, self.covariance - self.noise + rest_covariance(self.axis))


def _solved(
    stretches: Sequence[Stretch], pole: Floats, base: Floats, wider: float, spread: Floats
) -> tuple[_Solved, float]:
    """The axis, sought about ``base``, and by how much variances have to be larger for the residuals.

    ``spread`` (2, 2), rad^2, is how far it may lie from there.
    """
    parts = [_rows(s, base, spread) for s in stretches]
    own = sum(p.own.shape[1] for p in parts)
    mountings = mountings_of([p.dec_axis for p in parts])
    tilts = 1 + mountings[-1][0]
    doubts, rows, aims = [TUBE_ARCSEC * WORSE * ARCSEC] + [TILT_RAD] * tilts, [], []
    at = 3 + tilts
    for part, (mounting, side) in zip(parts, mountings, strict=True):
        count = part.own.shape[1]
        full = np.zeros((len(part.aim), 3 + tilts + own))
        full[:, :3], full[:, 3 + mounting] = part.common, side * part.tilted
        full[:, at : at + count] = part.own
        rows.append(full)
        aims.append(part.aim)
        doubts += part.doubts
        at += count
    matrix, aim = np.concatenate(rows) / np.sqrt(wider), np.concatenate(aims) / np.sqrt(wider)
    known = np.array([FAR_RAD, FAR_RAD, *doubts]) ** -2.0
    tracking = [_ra_row(s, base) for s in stretches if not (s.held or s.ra_held)]
    across = np.stack(tangents(base))
    normal, right = matrix.T @ matrix + np.diag(known), matrix.T @ aim
    right[:2] += across @ (pole - base) * known[:2]
    # RA runs at the sidereal rate within sigma: slope + bend . shift = 0
    for slope, bend, sigma in tracking:
        normal[:2, :2] += np.outer(bend, bend) / sigma**2
        right[:2] -= bend * slope / sigma**2
    answer = np.linalg.solve(normal, right)
    covariance = np.linalg.inv(normal)[:2, :2]
    free = np.append([True, True], np.array(doubts) == np.inf)  # noise alone: nothing bends, creeps or is pushed
    noise = np.linalg.inv(normal[np.ix_(free, free)])[:2, :2]
    pulses = _of_pulses(stretches, parts, np.linalg.solve(normal, matrix.T)[:2] / np.sqrt(wider))
    left = aim - matrix @ answer
    axis = _unit(base + answer[:2] @ across)
    if any(len(s.pulses_rad) for s in stretches):  # a star elsewhere in hour angle turns the error about the pole
        turned = np.array([[0.0, -1.0], [1.0, 0.0]]) @ across @ (axis - pole) * POINTING_RAD
        pulses = pulses + np.outer(turned, turned)
    found = _Solved(axis, pole, noise + pulses, covariance + pulses)
    return found, wider * _restless(left, parts, len(answer))


def _converged(
    stretches: Sequence[Stretch], pole: Floats, base: Floats, wider: float, spread: Floats
) -> tuple[_Solved, float]:
    """The axis sought about ``base`` first, then about what was found, until it stands still, and the same of it."""
    for _ in range(ROUNDS):
        found, worse = _solved(stretches, pole, base, wider, spread)
        moved, base, spread = angle_between(found.axis, base), found.axis, found.covariance
        if moved < STANDS_ARCSEC * ARCSEC:
            break
    return found, worse


def mountings_of(dec_axes: Sequence[Floats]) -> list[tuple[int, float]]:
    """Of each stretch which mounting of the camera it has, counted from 0, and 1, or -1 after a flip.

    ``dec_axes`` (3,) are where the camera has its Dec axis, by where it sees the pole. A flip brings that about by half
    a turn, and the camera still looks askew to the same end of it; one that somebody turned sits anew.
    """
    found = [(0, 1.0)]
    for before, now in pairwise(dec_axes):
        turned = angle_between(before, now)
        mounting, side = found[-1]
        if turned > np.pi - TURNED_RAD:
            found.append((mounting, -side))
        else:
            found.append((mounting, side) if turned < TURNED_RAD else (mounting + 1, 1.0))
    return found


def _of_pulses(stretches: Sequence[Stretch], parts: Sequence["_Rows"], gain: Floats) -> Floats:
    """Covariance (2, 2), rad^2, of what pulses moved: known to a share that the star's own path must not refine.

    A guider's pulses answer the noise of the positions, so a scale fitted to both is drawn towards nothing (0.48 of
    the drift at 0.25 px of seeing). ``gain`` (2, M) is of the axis by equation. Stretches of one calibration err alike.
    """
    by_calibration: dict[str, Floats] = {}
    ends = np.cumsum([len(p.aim) for p in parts])
    for stretch, part, end in zip(stretches, parts, ends, strict=True):
        moved = gain[:, end - len(part.aim) : end] @ part.pushed * stretch.pulse_share
        by_calibration[stretch.calibration] = by_calibration.get(stretch.calibration, np.zeros(2)) + moved
    return np.asarray(sum(np.outer(m, m) for m in by_calibration.values()))


@frozen(eq=False)
class _Rows:
    """Equations of one stretch, in sigmas: columns of axis and droop, columns of its own with their priors.

    ``pushed`` is the share of the pulses in ``aim``, ``tilted`` what a camera does to it that looks askew to its Dec
    axis by a radian; ``dec_axis`` (3,) is that axis in the camera.
    """

    common: Floats
    tilted: Floats
    dec_axis: Floats
    own: Floats
    aim: Floats
    pushed: Floats
    doubts: list[float]


def upright(boresights: Floats, axis: Floats) -> Floats:
    """Camera axes (N, 3, 3) in E, N, U about directions (N, 3), an axis (3,) up as an equatorial mount holds them."""
    across = cross_product(boresights, axis)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    return np.stack([across, cross_product(boresights, across), boresights], axis=-1)


def _matrices(stretch: Stretch, axis: Floats) -> Floats:
    """Camera axes (N, 3, 3) in E, N, U; of a guide star as the mount would hold them had no pulse moved Dec.

    Half a degree of pulses at 70 deg of Dec must be undone by a turn: added up they would be 40 arcsec wrong.
    """
    matrices = np.stack([a.matrix for a in stretch.attitudes])
    if not len(stretch.pulses_rad):
        return matrices
    places, moved = matrices[:, :, 2], stretch.pulses_rad[:, None]
    towards = axis - (places @ axis)[:, None] * places
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    return upright(np.cos(moved) * places - np.sin(moved) * towards, axis)


def _rows(stretch: Stretch, pole: Floats, spread: Floats) -> _Rows:
    """Where the camera sees the axis, along w (drift in Dec) and n (rotation of the field), both across it."""
    measured = _matrices(stretch, pole)
    in_camera = (pole @ measured).mean(axis=0)  # where the camera sees the pole, R^T p, in the mean
    in_camera /= np.linalg.norm(in_camera)
    n = cross_product(in_camera, [0.0, 0.0, 1.0])
    n = n / np.linalg.norm(n) if np.linalg.norm(n) > 1e-6 else np.array([1.0, 0.0, 0.0])
    w = cross_product(in_camera, n)
    seen = np.stack([w, n])
    upward, clockwise = tangents(pole)
    aim, high, around = (np.einsum("ij,kj->ki", seen, v @ measured) for v in (pole, upward, clockwise))
    count, hours = len(measured), stretch.seconds / 3600.0
    rho = angle_between(pole, measured[0, :, 2])
    droops = high * lever(pole, rho)
    steps = stretch.steps if len(stretch.steps) else np.zeros(count)
    pulses = stretch.pulses_rad if len(stretch.pulses_rad) else np.zeros(count)
    zero, names = np.zeros(count), np.unique(steps)
    # Own unknowns: Dec after each dither, the rotation, the creep of each an hour, and what RA leaks into Dec.
    columns = [np.stack([(steps == name) * 1.0, zero], axis=-1) for name in names]
    columns += [np.stack([zero, np.ones(count)], axis=-1), np.stack([hours, zero], axis=-1)]
    columns += [np.stack([zero, hours], axis=-1)]
    doubts = [np.inf] * (len(names) + 1) + [CREEP_ARCSEC_H * ARCSEC] * 2
    if stretch.ra_rad.any():
        columns += [np.stack([stretch.ra_rad, zero], axis=-1)]
        doubts += [LEAK]
    pushed = np.stack([pulses, zero], axis=-1)
    # A small rotation v about the camera's axes moves the axis by v . n along w and by -v . w along n.
    noisy = np.stack([n, -w])
    covariances = np.stack([noisy @ a.covariance @ noisy.T for a in stretch.attitudes])
    if stretch.held:
        covariances[:, 0, 0] += 1.0  # a radian: Dec that a guider held says nothing
    tilted = np.zeros((count, 2))
    if stretch.held:
        sine, by_axis = max(float(np.sin(rho)), LEAST_SIN), np.stack([high, around], axis=-1)
        guided, drift = ((each[:, 0] - each[:, 0].mean(axis=0)) / sine for each in (aim, by_axis))
        # Dec turns about an axis square to the polar axis, and not to a camera that looks askew: of what a guider
        # turned it by, a share of tilt / sin(rho) passes for rotation of the field, which near the pole is much.
        tilted[:, 1] = guided
        # An axis aside of where it is sought has its Dec axis aside as well.
        aside = by_axis[:, 1].mean(axis=0) * np.cos(rho)
        high, around = (
            np.stack([v[:, 0], v[:, 1] - a * guided], axis=-1) for v, a in zip((high, around), aside, strict=True)
        )
        # Far along a long ellipse the guider turned Dec by other amounts: tilt times distance, and distance squared,
        # which no linear fit sees, count by their own second moments (3 sigma^4 for the square).
        for variance, way in zip(*_principal(spread), strict=True):
            columns += [np.stack([zero, drift @ way], axis=-1)]
            doubts += [float(np.sqrt(variance) * np.hypot(TILT_RAD, np.sqrt(3.0 * variance) * (aside @ way)))]
    whiten = np.linalg.inv(np.linalg.cholesky(covariances))
    common, own = -np.stack([high, around, droops], axis=-1), np.stack(columns, axis=-1)
    each = (common, tilted[..., None], own, aim[..., None], pushed[..., None])
    rows = [(whiten @ part).reshape(2 * count, -1) for part in each]
    return _Rows(rows[0], rows[1][:, 0], n, rows[2], rows[3][:, 0], rows[4][:, 0], doubts)


def _principal(covariance: Floats) -> tuple[Floats, Floats]:
    """Variances (2,), above zero, and the unit vectors (2, 2), a row each, along which they lie."""
    values, vectors = np.linalg.eigh(covariance)
    return np.maximum(values, ARCSEC**2), vectors.T


def _ra_row(stretch: Stretch, pole: Floats) -> tuple[float, Floats, float]:
    """By how much RA runs fast, rad/s, how an axis elsewhere changes that (2,), and one sigma of the rate."""
    seconds = stretch.seconds
    places = np.stack([a.boresight for a in stretch.attitudes])
    rho = np.arccos(np.clip(places @ pole, -1.0, 1.0)).mean()

    def slope(axis: Floats) -> float:
        upward, clockwise = tangents(axis)
        around = np.unwrap(np.arctan2(places @ clockwise, places @ upward))
        return float(np.polyfit(seconds, around, 1)[0])

    here = slope(pole)
    step = 60.0 * ARCSEC
    bend = np.array([slope(_unit(pole + step * t)) - slope(_unit(pole - step * t)) for t in tangents(pole)])
    span = float(seconds[-1])
    # the slope a worm can feign: its steepest over short spans, 6 A P / (pi T^2) of a line fitted over long ones
    worm = PERIODIC_ARCSEC * min(2.0 * np.pi / WORM_S, 6.0 * WORM_S / (np.pi * span**2))
    # variance of the slope of N even points over T: 12 sigma^2 / (N T^2)
    scatter = float(np.sqrt(np.trace(stretch.attitudes[0].covariance[:2, :2]) * 6.0 / len(seconds))) / span
    sigma = np.hypot(np.hypot(RATE_ARCSEC_H / 3600.0, worm) * ARCSEC, scatter / max(float(np.sin(rho)), 0.01))
    return here - np.copysign(SIDEREAL_RAD_S, here), bend / (2.0 * step), float(sigma)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))


def _restless(left: Floats, parts: Sequence[_Rows], unknown: int) -> float:
    """How much larger than stated the variances are: by chi-square, and by what blocks of neighbours share."""
    worse, at = max(1.0, float(left @ left) / max(len(left) - unknown, 1)), 0
    for part in parts:
        own = left[at : at + len(part.aim)].reshape(-1, 2)[:, 0]
        at += len(part.aim)
        each = len(own) // BLOCKS
        if each >= 2:  # white noise averages out over a block; what neighbours share does not
            means = own[: each * BLOCKS].reshape(BLOCKS, each).mean(axis=1)
            worse = max(worse, float(each * means @ means) / (BLOCKS - 3))
    return worse


# -- What to say, and how long more -----------------------------------------------------------------------------


DEC_SIGN = tr_noop(
    "The guide log doesn't say which way its Dec pulses move the mount: the error may be to the other side."
)
AGAINST = tr_noop(
    "Dec pulses moved the guide star against the calibration in the log (a flip, or reversed output): north and south"
    " are not known."
)
AGAINST_EITHER = tr_noop(
    "Dec pulses moved the guide star against the calibration in the log (a flip, or reversed output). If north pulses"
    " move the mount north: {plus}. If they move it south: {minus}. Say which."
)
EITHER = tr_noop(
    "The guide log doesn't say which way its Dec pulses move the mount. If north pulses move it north: {plus}."
    " If they move it south: {minus}. Say which."
)
FAR = tr_noop("The axis is {off:.0f}° from the pole. Check the site and the time, and that the mount tracked.")
KNOCKED = tr_noop(
    "The field turned by {angle} between {before} and {after}: the tripod, a bolt or the camera moved. Use the frames"
    " before or after that alone."
)
OTHER_AXIS = tr_noop("Part {part} of {parts} shows another axis. Was a bolt turned, or the mount guided?")
GUIDED = tr_noop(
    "Guided frames hold their place: only the rotation of the field counts. If you did not guide, set Guided to no."
)
CREEPS = tr_noop(
    "Flexure not measured (±{sigma} assumed): creep of the tube or camera in Dec looks like an axis error. Frames on"
    " the other side of the meridian would show it."
)
LOW = tr_noop("A frame is only {high:.0f}° above the horizon, where refraction is hard to predict.")
UNSEEN = {
    Knob.ALTITUDE: tr_noop(
        "The drift can't tell altitude yet (±{sigma}). A place in the east or the west, 6 h from the meridian tells it"
        " sooner."
    ),
    Knob.AZIMUTH: tr_noop("Azimuth not measured yet (±{sigma}); a field near the meridian is faster."),
}


def _doubts(stretches: Sequence[Stretch], wider: float, all_of_them: _Solved) -> list[PolarFinding]:
    """What leaves the axis unknown: Dec without a sign, stretches that show different axes."""
    found = []
    if (off_deg := all_of_them.error.total_arcsec / 3600.0) > FAR_DEG:
        found.append(PolarFinding(PolarFindingKind.FAR, tr(FAR, off=off_deg), spoils=True))
    if knock := next((s.knock for s in stretches if s.knock is not None), None):
        text = tr(KNOCKED, before=knock.before, after=knock.after, angle=angle_in_words(knock.angle_arcsec))
        found.append(PolarFinding(PolarFindingKind.MOUNT_MOVED, text, spoils=True))
    if not all(s.sign_known for s in stretches):
        text = tr(AGAINST if any(s.against_calibration for s in stretches) else DEC_SIGN)
        found.append(PolarFinding(PolarFindingKind.DEC_SIGN, text, spoils=True))
    for number, stretch in enumerate(stretches, 1):
        alone, _ = _solved((stretch,), all_of_them.pole, all_of_them.axis, wider, all_of_them.covariance)
        gap = np.stack(tangents(all_of_them.axis)) @ (alone.axis - all_of_them.axis)
        if len(stretches) > 1 and gap @ np.linalg.solve(alone.covariance, gap) > 2.0 * CHI2_95:
            text = tr(OTHER_AXIS, part=number, parts=len(stretches))
            found.append(PolarFinding(PolarFindingKind.DISAGREE, text, spoils=True))
            break
    return found


def either(north: Drift, south: Drift) -> Drift:
    """Both answers of a drift whose Dec has no sign: as if north pulses moved the mount north, and south."""
    against = any(s.against_calibration for s in north.stretches)
    text = tr(AGAINST_EITHER if against else EITHER, plus=north.where, minus=south.where)
    findings = (replace(f, text=text) if f.kind is PolarFindingKind.DEC_SIGN else f for f in north.findings)
    return replace(north, findings=tuple(findings), otherwise=south.error)


def _findings(stretches: Sequence[Stretch], error: PolarError, lowest_deg: float) -> list[PolarFinding]:
    found = []
    if any(s.held for s in stretches):
        found.append(PolarFinding(PolarFindingKind.GUIDED, tr(GUIDED)))
    if lowest_deg < LOWEST_DEG:
        found.append(PolarFinding(PolarFindingKind.LOW, tr(LOW, high=lowest_deg)))
    long, _, angle = error.ellipse_arcsec()
    if long > 2.0 * KNOWN_ARCSEC:
        altitude = abs(np.sin(angle)) > np.sqrt(0.5)  # the long axis stands nearer to altitude
        text = tr(UNSEEN[Knob.ALTITUDE if altitude else Knob.AZIMUTH], sigma=angle_in_words(long))
        found.append(PolarFinding(PolarFindingKind.UNSEEN, text))
    if len({s.attitudes[0].boresight[0] > 0.0 for s in stretches}) == 1:
        # what drifts in Dec by so much is an axis that is off by the drift of an hour over the sky's turn in it
        assumed = angle_in_words(CREEP_ARCSEC_H / (3600.0 * SIDEREAL_RAD_S))
        found.append(PolarFinding(PolarFindingKind.FLEXURE_NOT_MEASURED, tr(CREEPS, sigma=assumed)))
    return found


def _minutes_more(stretches: Sequence[Stretch], found: _Solved, wider: float) -> float | None:
    """How much longer the last place has to be tracked at the same pace, all else alike."""
    error = found.error
    if error.uncertainty_arcsec <= KNOWN_ARCSEC:
        return 0.0
    last = stretches[-1]
    span, count = float(last.seconds[-1]), len(last.attitudes)
    way = float(np.copysign(SIDEREAL_RAD_S, _went_rad(last.attitudes[-1], last.attitudes[0], error.axis)))
    more = max(span / 4.0, 300.0)
    while more <= LONGEST_H * 3600.0:
        times = np.arange(1, max(2, round(count * more / span)) + 1) * span / max(count - 1, 1)
        # At most some 60 frames stand for all that will come; each counts for several by a smaller covariance.
        times = times[:: max(1, len(times) // 60)]
        thin = (count * more / span) / len(times)
        later = [
            replace(
                last.attitudes[-1],
                matrix=about(error.axis, way * t) @ last.attitudes[-1].matrix,
                covariance=last.attitudes[-1].covariance / max(thin, 1.0),
                time_utc=last.attitudes[-1].time_utc + timedelta(seconds=float(t)),
            )
            for t in times
        ]
        if later[-1].altitude_deg < LOWEST_DEG:
            return None
        steps = np.append(last.steps, np.full(len(later), last.steps[-1])) if len(last.steps) else last.steps
        pulses = np.append(last.pulses_rad, np.full(len(later), last.pulses_rad[-1])) if len(last.pulses_rad) else steps
        lags = np.append(last.ra_rad, np.zeros(len(later))) if len(last.ra_rad) else last.ra_rad
        longer = replace(last, attitudes=(*last.attitudes, *later), steps=steps, pulses_rad=pulses, ra_rad=lags)
        solved, _ = _solved((*stretches[:-1], longer), found.pole, found.axis, wider, found.covariance)
        if solved.error.uncertainty_arcsec <= KNOWN_ARCSEC:
            return more / 60.0
        more *= 1.25
    return None


def _went_rad(attitude: LocalAttitude, first: LocalAttitude, axis: Floats) -> float:
    """How far the boresight went about an axis since the first, radians."""
    upward, clockwise = tangents(axis)
    now, then = (np.arctan2(b @ clockwise, b @ upward) for b in (attitude.boresight, first.boresight))
    return wrapped_rad(float(now - then))
