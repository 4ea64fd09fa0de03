"""What the thesis "Attitude from stellar images" prints of its three frames, tables 4.1 to 4.21."""

from dataclasses import dataclass

FIELD_DEG = (9.0130, 6.9049)


@dataclass(frozen=True, slots=True)
class Printed:
    """One frame: ``centroids`` px from its centre, y up, brightest first, and what came of them.

    ``fixed_deg`` are the separations in fixed point (1-2, 1-3, ..., 2-3, ...); ``pairs`` is the
    sum of the catalogue pairs found, ``groups`` and ``largest`` of the triads.
    """

    name: str
    size: tuple[int, int]
    centroids: tuple[tuple[float, float], ...]
    stars: tuple[int, ...]
    centre_deg: tuple[float, float] | None
    largest_error_deg: float | None
    pairs: int
    triads: int
    groups: int
    largest: int
    centroid_off_px: float
    separation_off_deg: float
    seconds: float | None
    seconds_fixed: float | None
    separations_deg: tuple[float, ...]
    fixed_deg: tuple[float, ...]


VEGA = Printed(
    "Vega", (427, 319),
    (
        (16.13144, 74.39691), (-162.81865, 95.40933), (-73.08759, 69.96350),
        (-15.73050, 143.07092), (79.27619, -113.87619),
    ),
    (7001, 7139, 7056, 7051, 6872), (278.45703, 37.24007), 0.02129,
    5503, 26, 8, 12, 0.00004, 0.00317, 0.232, 0.197,
    (3.8045, 1.8857, 1.6315, 4.2873, 1.9725, 3.2715, 6.8250, 1.9924, 5.1148, 5.9112),
    (3.8027, 1.8848, 1.6309, 4.2861, 1.9717, 3.2715, 6.8281, 1.9912, 5.1152, 5.9102),
)  # fmt: skip
DENEB = Printed(
    "Deneb", (424, 320),
    (
        (-76.22261, 56.43993), (67.43734, -126.10052), (101.86992, -94.63821),
        (-57.83884, 124.35950), (112.81633, 29.45918), (121.36667, 42.18889),
        (-144.14078, 135.27670), (-109.93023, 145.53488), (-0.88889, -81.14444),
    ),
    (7924, 7735, 7751, 7977, 7844, 7851, 8001, 8003, 7798), (307.90724, 46.43192), 0.02184,
    21283, 96, 36, 23, 0.00006, 0.0028, 0.644, 0.622,
    (
        4.9825, 4.9943, 1.5168, 4.0603, 4.2114, 2.2311, 2.0516, 3.3728, 0.9983, 6.0231, 3.4923,
        3.8077, 7.2091, 6.9657, 1.7465, 5.8163, 2.6878, 2.9814, 7.2035, 6.8609, 2.2037, 4.1650,
        4.2013, 1.8496, 1.1979, 4.5963, 0.3294, 5.9189, 5.3552, 3.3962, 5.9896, 5.3976, 3.7190,
        0.7602, 5.5732, 5.4115,
    ),
    (
        4.9814, 4.9941, 1.5156, 4.0586, 4.2099, 2.2295, 2.0508, 3.3721, 0.9971, 6.0234, 3.4912,
        3.8066, 7.2119, 6.9678, 1.7461, 5.8174, 2.6865, 2.9805, 7.2060, 6.8633, 2.2021, 4.1641,
        4.2002, 1.8486, 1.1963, 4.5947, 0.3271, 5.9189, 5.3555, 3.3955, 5.9902, 5.3974, 3.7188,
        0.7588, 5.5732, 5.4111,
    ),
)  # fmt: skip
SADR = Printed(
    "Sadr", (469, 360),
    ((-24.02893, 58.39256), (-64.56410, -55.32051), (-80.65517, -124.93103)),
    (7796, 7763, 7736), None, None, 1086, 2, 2, 1, 0.00004, 0.0015, None, None,
    (2.3159, 3.6805, 1.3705), (2.3145, 3.6797, 1.3691),
)  # fmt: skip
