"""Orbits about the Sun: two bodies in any conic, and carried by integration under the pull of the planets."""

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import cross_product, unit
from kochab.core.progress import Progress, Task
from kochab.sky.ephemeris import GM, Ephemeris

OBLIQUITY = np.radians(84381.448 / 3600.0)
"""Of the ecliptic of J2000 that orbital elements are given on (IAU 1976)."""

PLANETS = tuple(name for name in GM if name != "sun")
MASSES = np.array([GM[name] for name in PLANETS])
SLOPE_DAYS = 1e-3
"""Either side of a moment, for a planet's velocity: Mercury's is then off by 1e-10 au/day."""


def state_at_perihelion(q_au: Floats, e: Floats, i_deg: Floats, node_deg: Floats, peri_deg: Floats) -> Floats:
    """Heliocentric states (N, 6), au and au/day on ICRS axes, at perihelion.

    Parameters
    ----------
    q_au : Floats
        Perihelion distances (N,), au.
    e : Floats
        Eccentricities (N,).
    i_deg, node_deg, peri_deg : Floats
        Inclination, ascending node and argument of perihelion (N,), degrees, on the ecliptic of J2000.
    """
    i, node, peri = np.radians([i_deg, node_deg, peri_deg])
    ci, si, cn, sn, cp, sp = np.cos(i), np.sin(i), np.cos(node), np.sin(node), np.cos(peri), np.sin(peri)
    towards = np.stack([cn * cp - sn * sp * ci, sn * cp + cn * sp * ci, sp * si], axis=-1)
    ahead = np.stack([-cn * sp - sn * cp * ci, -sn * sp + cn * cp * ci, cp * si], axis=-1)
    speed = np.sqrt(GM["sun"] * (1.0 + e) / q_au)
    ce, se = np.cos(OBLIQUITY), np.sin(OBLIQUITY)
    to_equator = np.array([[1.0, 0.0, 0.0], [0.0, ce, -se], [0.0, se, ce]])
    return np.hstack([(q_au[:, None] * towards) @ to_equator.T, (speed[:, None] * ahead) @ to_equator.T])


def two_body(state: Floats, days: Floats) -> Floats:
    """States (N, 6) a number of days (N,) later, of an ellipse, parabola or hyperbola about the Sun alone.

    Universal variables (Bate, Mueller and White 1971, ch. 4), solved by Laguerre's method (Conway 1986).
    """
    root = np.sqrt(GM["sun"])
    place, velocity = state[:, :3], state[:, 3:]
    r0 = np.linalg.norm(place, axis=1)
    outward = np.einsum("na,na->n", place, velocity) / root
    bound = inverse_axis(state)
    # inverse_axis is 1/a: positive for an ellipse, 0 for a parabola, negative for a hyperbola
    period = 365.25 * period_years(state)
    # whole revolutions change nothing; without them chi is small and converges soon
    turns = np.where(np.isfinite(period), np.rint(days / period) * np.nan_to_num(period, posinf=0.0), 0.0)
    target = root * (days - turns)
    x = np.sign(target) * np.minimum(np.abs(target) / r0, np.cbrt(6.0 * np.abs(target)))
    for _ in range(50):
        c, s = stumpff(bound * x * x)
        missing = outward * x**2 * c + (1.0 - bound * r0) * x**3 * s + r0 * x - target
        r = outward * x * (1.0 - bound * x * x * s) + (1.0 - bound * r0) * x * x * c + r0
        bend = outward * (1.0 - bound * x * x * c) + (1.0 - bound * r0) * x * (1.0 - bound * x * x * s)
        # Laguerre with n = 5; the abs keeps the root real, so any start converges
        step = 5.0 * missing / (r + np.sign(r) * np.sqrt(np.abs(16.0 * r * r - 20.0 * missing * bend)))
        x = x - step
        if np.all(np.abs(step) < 1e-12 * (1.0 + np.abs(x))):
            break
    c, s = stumpff(bound * x * x)
    f, g = 1.0 - x * x * c / r0, (target - x**3 * s) / root
    later = f[:, None] * place + g[:, None] * velocity
    r = np.linalg.norm(later, axis=1)
    df, dg = root / (r * r0) * (bound * x**3 * s - x), 1.0 - x * x * c / r
    return np.hstack([later, df[:, None] * place + dg[:, None] * velocity])


def inverse_axis(state: Floats) -> Floats:
    """One over the semi-major axis (N,), 1/au: negative of a hyperbola."""
    speed2 = np.einsum("na,na->n", state[:, 3:], state[:, 3:])
    return np.asarray(2.0 / np.linalg.norm(state[:, :3], axis=1) - speed2 / GM["sun"])


def period_years(state: Floats) -> Floats:
    """Periods (N,) of heliocentric states (N, 6), infinite of what does not return."""
    bound = inverse_axis(state)
    # 1/a below this is a parabola within rounding: its period would be 1e13 years or more
    closed = bound > 1e-9
    return np.where(closed, np.where(closed, bound, 1.0) ** -1.5 * 2.0 * np.pi / np.sqrt(GM["sun"]) / 365.25, np.inf)


def days_since_perihelion(state: Floats) -> Floats:
    """Days (N,) since the perihelion of heliocentric states (N, 6), negative before it, as of parabolas: of comets.

    Barker's equation; of an ellipse far from its perihelion it is a few per cent off.
    """
    places, speeds = state[:, :3], state[:, 3:]
    p = np.sum(cross_product(places, speeds) ** 2, axis=1) / GM["sun"]
    towards = cross_product(speeds, cross_product(places, speeds)) / GM["sun"] - unit(places)
    q = p / (1.0 + np.linalg.norm(towards, axis=1))
    half = np.sqrt(np.maximum(np.linalg.norm(places, axis=1) / q - 1.0, 0.0))  # tan(v / 2) of a parabola
    days = np.sqrt(2.0 * q**3 / GM["sun"]) * (half + half**3 / 3.0)
    return np.asarray(np.sign(np.einsum("na,na->n", places, speeds)) * days)


def stumpff(z: Floats) -> tuple[Floats, Floats]:
    """The functions C and S (N,) of universal variables."""
    root = np.sqrt(np.abs(z))
    # the closed forms subtract nearly equal numbers there; the series is exact to 1e-13
    near = np.abs(z) < 1e-3
    safe = np.where(near, 1.0, root)
    ellipse = z > 0.0
    narrow = np.where(ellipse, 0.0, np.minimum(safe, 300.0))
    c = np.where(ellipse, 1.0 - np.cos(safe), np.cosh(narrow) - 1.0) / safe**2
    s = np.where(ellipse, safe - np.sin(safe), np.sinh(narrow) - safe) / safe**3
    c = np.where(near, 0.5 - z / 24.0 + z * z / 720.0, c)
    return c, np.where(near, 1.0 / 6.0 - z / 120.0 + z * z / 5040.0, s)


def carried(
    state: Floats, from_jd: Floats, to_jd: float, ephemeris: Ephemeris, precision: float = 1e-9
) -> Task[Floats]:
    """States (N, 6) at another date.

    The Sun and eight planets pull; relativity, the asteroids' own masses and the jets of comets are left out. Dormand
    and Prince's method of order 8 over the share of each body's own time, so that all arrive together.

    Parameters
    ----------
    state : Floats
        Heliocentric states (N, 6), au and au/day on ICRS axes.
    from_jd : Floats
        When they were so (N,), Julian date TDB.
    to_jd : float
        When they are wanted, Julian date TDB.
    ephemeris : Ephemeris
        Barycentric places of the Sun and the planets.
    precision : float
        Relative error of a step.
    """
    days = to_jd - from_jd
    if not len(state) or not days.any():
        return state
    # one common date: the planets are needed for one moment a step, not for one of each body
    same_span = np.all(days == days[0])
    first, span = (from_jd[:1], days[:1]) if same_span else (from_jd, days)

    from scipy.integrate import DOP853  # a third of a second, which the window's start need not take
    from scipy.interpolate import CubicHermiteSpline

    # A day apart, between which a cubic misses Mercury by 3e-8 au: one look each step in place of nine. Its slopes are
    # those of the ephemeris: to solve for them takes SciPy's LAPACK, which the .deb leaves out.
    begun = min(float(from_jd.min()), to_jd)
    end = max(float(from_jd.max()), to_jd)
    nodes = np.linspace(begun, end, max(8, round(end - begun) + 1))
    before = np.maximum(nodes - SLOPE_DAYS, ephemeris.first_jd)
    after = np.minimum(nodes + SLOPE_DAYS, ephemeris.last_jd)
    times = np.concatenate([nodes, before, after])
    sun = ephemeris("sun", times)
    at, earlier, later = np.split(np.stack([ephemeris(name, times) - sun for name in PLANETS], axis=1), 3)
    planets = CubicHermiteSpline(nodes - begun, at, (later - earlier) / (after - before)[:, None, None])

    def slope(share: float, flat: Floats) -> Floats:
        now = flat.reshape(-1, 6)
        accelerations = acceleration(now[:, :3], planets(first - begun + share * span))
        return (np.hstack([now[:, 3:], accelerations]) * span[:, None]).ravel()

    solver = DOP853(slope, 0.0, state.ravel(), 1.0, rtol=precision, atol=precision * 1e-2)
    while solver.status == "running":
        solver.step()
        yield Progress("Carrying asteroids and comets to the frame's date", float(solver.t))
    return np.asarray(solver.y).reshape(-1, 6)


def acceleration(places: Floats, planets: Floats) -> Floats:
    """Pull (N, 3), au/day^2, of the Sun and ``planets`` (N or 1, 8, 3) on bodies at heliocentric places (N, 3) au."""
    gap = planets - places[:, None]
    # the second term is the Sun's own acceleration: the frame is heliocentric, not inertial
    accelerations = gap / _cubed(gap) - planets / _cubed(planets)
    return np.asarray(np.einsum("p,npa->na", MASSES, accelerations) - GM["sun"] * places / _cubed(places))


def _cubed(vectors: Floats) -> Floats:
    return np.asarray(np.einsum("...a,...a->...", vectors, vectors)[..., None] ** 1.5)
