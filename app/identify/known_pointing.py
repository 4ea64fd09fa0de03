"""The attitude that puts two stars where they are seen, in plain numbers: ten times as quick."""

import math

Vector = tuple[float, float, float]


def two_stars(
    p: Vector, q: Vector, star_p: list[float], star_q: list[float]
) -> tuple[Vector, Vector, Vector]:
    """Rotation, three rows, ICRS to camera, for two directions and the stars that they are.

    ``p`` and ``q`` point where the two are seen, in camera axes, of any length; the stars are ICRS
    unit vectors. What the separations differ by is shared: the middles agree, and the planes.
    """
    (m, n, o), (k, l, r) = _axes(_unit(*p), _unit(*q)), _axes(star_p, star_q)  # noqa: E741
    x, y, z = [
        (
            a * k[0] + b * l[0] + c * r[0],
            a * k[1] + b * l[1] + c * r[1],
            a * k[2] + b * l[2] + c * r[2],
        )
        for a, b, c in zip(m, n, o, strict=True)
    ]
    return x, y, z


def triple(p: list[float], q: list[float], r: list[float]) -> float:
    """The triple product of three vectors: its sign tells their sense, seen from within."""
    return (
        p[0] * (q[1] * r[2] - q[2] * r[1])
        + p[1] * (q[2] * r[0] - q[0] * r[2])
        + p[2] * (q[0] * r[1] - q[1] * r[0])
    )


def _axes(a: Vector | list[float], b: Vector | list[float]) -> tuple[Vector, Vector, Vector]:
    """Right-handed axes from the middle of two unit vectors and the plane they lie in."""
    m = _unit(a[0] + b[0], a[1] + b[1], a[2] + b[2])
    n = _unit(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    across = (m[1] * n[2] - m[2] * n[1], m[2] * n[0] - m[0] * n[2], m[0] * n[1] - m[1] * n[0])
    return m, n, across


def _unit(x: float, y: float, z: float) -> Vector:
    length = math.sqrt(x * x + y * y + z * z) or 1.0
    return x / length, y / length, z / length
