"""A minute that touches every room, for the loop while one works: ``make smoke``.

What bites is the whole of ``make test``; this only tells soon that a room stands no longer.
"""

import os
import sys
from pathlib import Path

import pytest

from tests.patterns import REPOSITORY

SMOKE = {
    "attitude": ("attitude/test_wahba.py", "attitude/test_projection.py"),
    "cli": ("cli/test_conventions.py", "cli/test_identify.py"),
    "core": ("core/test_attitude.py", "core/test_camera.py", "core/test_options.py", "core/test_values.py"),
    "parsing": ("parsing",),
    "text": ("text",),
    "detection": ("detection/test_parts.py",),
    "frames": ("frames/test_fits_write.py", "frames/test_stretch.py", "frames/test_hints.py"),
    "gear": ("gear/mounts/test_guard.py", "gear/mounts/test_protocols.py", "gear/cameras/test_address.py"),
    "identification": ("identification/test_codes.py", "identification/test_shapes.py"),
    "lab": ("lab/methods/test_pairs.py", "lab/bench/test_report.py"),
    "polar": ("polar/test_axis.py", "polar/test_plan.py", "polar/test_report.py"),
    "pointing": ("pointing/test_disagreement_odds.py",),
    "server": ("server/test_api.py", "server/test_nova.py", "server/test_phone_page.py"),
    "simulate": ("simulate/test_clock.py", "simulate/test_mechanics_axis.py", "simulate/test_stars.py"),
    "sky": ("sky/test_container.py", "sky/test_apparent.py", "sky/test_finder.py"),
    "solver": ("solver/test_estimate.py", "solver/test_growth.py", "solver/test_pairing.py"),
    "window": ("window/test_entry.py", "window/image/test_object_card.py", "window/charts"),
    "workflows": ("workflows/test_solve_frame.py", "workflows/test_sync_mount.py"),
}
"""The room, and its files below ``tests``."""


def files() -> list[Path]:
    """All of them."""
    return [REPOSITORY / "tests" / name for names in SMOKE.values() for name in names]


if __name__ == "__main__":
    # Each process imports for ten seconds of processor: no more of them than cores.
    how = ("-n", str(min(os.cpu_count() or 1, 4)), "--hypothesis-profile", "smoke")
    sys.exit(pytest.main(["-q", *how, *map(str, files()), *sys.argv[1:]]))
