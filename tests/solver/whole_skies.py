"""Star lists of fisheye lenses of four projections, 90 to 200 deg wide, made without the product's cameras.

``python -m tests.solver.whole_skies 100`` solves so many of each and prints how many were found and how many are wrong.
"""

import sys

import numpy as np

from kochab.core.attitude import apart_deg, radec_deg
from kochab.core.frame import Detections
from kochab.core.progress import run
from kochab.core.solution import Solution
from kochab.sky import open_catalogue
from kochab.solver.pipeline import solve_detections
from tests.solver.fields import YEAR

RADII = {  # r over f at an angle from the axis (Ray 2002, Applied Photographic Optics, section 30)
    "equidistant": lambda theta: theta,
    "equisolid": lambda theta: 2.0 * np.sin(theta / 2.0),
    "stereographic": lambda theta: 2.0 * np.tan(theta / 2.0),
    "orthographic": lambda theta: np.sin(np.minimum(theta, np.pi / 2.0)),
}
SIDE_PX = 1600
STARS = 450


def whole_sky(projection, field_deg, rng, sigma_px=0.3, missing=0.1, spurious=40):
    """Detections, and the ICRS direction of the middle; half the field lies across the frame's side."""
    axis, up = rng.normal(size=(2, 3))
    z = axis / np.linalg.norm(axis)
    x = np.cross(up, z)
    x /= np.linalg.norm(x)
    catalogue = open_catalogue()
    half = np.radians(field_deg) / 2.0
    rows = catalogue.brightest(z, min(half * 1.5, np.pi / 2.0), STARS, YEAR)
    seen = catalogue.vectors(rows, YEAR) @ np.stack([x, np.cross(z, x), z]).T
    theta, way = np.arccos(np.clip(seen[:, 2], -1.0, 1.0)), np.arctan2(seen[:, 1], seen[:, 0])
    radius = SIDE_PX / 2.0 * RADII[projection](theta) / RADII[projection](half)
    xy = (SIDE_PX - 1) / 2.0 + radius[:, None] * np.stack([np.cos(way), np.sin(way)], axis=-1)
    kept = (
        (theta < np.pi / 2.0)
        & (rng.random(len(xy)) >= missing)
        & (np.abs(xy - SIDE_PX / 2.0) < SIDE_PX / 2.0).all(axis=1)
    )
    # stars near the horizon are dimmed by the air, 0.2 mag an airmass
    flux = 10.0 ** (-0.4 * (catalogue.mag(rows) + 0.2 / np.maximum(np.cos(theta), 0.1)))
    xy, flux = xy[kept] + rng.normal(0.0, sigma_px, (kept.sum(), 2)), flux[kept]
    false = rng.uniform(0.0, SIDE_PX, (spurious, 2))
    flux = np.concatenate([flux, rng.choice(flux, spurious)])
    return Detections.from_list(np.concatenate([xy, false]), SIDE_PX, SIDE_PX, flux), z


def solved(projection, field_deg, seed):
    """The solution or refusal, and how far its middle is from the truth, degrees."""
    detections, middle = whole_sky(projection, field_deg, np.random.default_rng([seed, int(field_deg)]))
    answer = run(solve_detections(detections))
    if not isinstance(answer, Solution):
        return answer, np.nan
    return answer, apart_deg(answer.ra_dec_deg, radec_deg(middle))


if __name__ == "__main__":
    COUNT = int(sys.argv[1])
    for kind in RADII:
        for field in (90.0, 120.0, 150.0, 180.0, 200.0):
            if kind == "orthographic" and field >= 180.0:
                continue
            answers = [solved(kind, field, seed) for seed in range(COUNT)]
            off = np.array([away for _, away in answers])
            found = np.isfinite(off)
            stars = [len(a.stars) for a, _ in answers if isinstance(a, Solution)]
            rms = [a.rms_px for a, _ in answers if isinstance(a, Solution)]
            print(
                f"{kind:14} {field:4.0f} deg: {found.sum()} of {COUNT}, wrong by 0.3 deg {np.sum(off > 0.3)}, "
                f"median {np.median(off[found]) if found.any() else np.nan:.4f} deg, "
                f"{np.median(stars) if stars else 0:.0f} stars, RMS {np.median(rms) if rms else np.nan:.2f} px",
                flush=True,
            )
