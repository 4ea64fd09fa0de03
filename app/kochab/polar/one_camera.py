"""All frames of an alignment fitted with one camera, so that only their attitudes differ.

A frame alone has to find its optical centre, distortion and attitude from its own stars, and bends its camera until
that looks like the refraction it knows nothing of: low frames of wide fields lose a factor of ten by it. Here stars
are taken where the air shows them, all frames share one centre and one distortion, and each has its attitude and
its scale. What is wrong with the camera is then wrong in all frames alike and does not move the axis.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kochab.attitude.fit import refine
from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.solution import Matches
from kochab.polar.rotations import best_rotation
from kochab.polar.sighting import LocalAttitude, covariance_of, in_plain_axes, plain_focal_px

ROUNDS = 2
SAME_SCALE = 0.01  # refraction changes a low frame's scale by a tenth of that
CUT_SCALE = 0.03  # distortion makes the middle of a cut-out look longer or shorter by that
LOWEST = np.sin(np.radians(10.0))  # below, two terms of refraction are arcseconds off
FEWEST = 6


def with_one_camera(attitudes: Sequence[LocalAttitude]) -> tuple[list[LocalAttitude], Camera | None]:
    """The same frames fitted with one camera, and that camera; as they are, and None, where they can't share one."""
    frames = list(attitudes)
    camera = frames[0].camera if len(frames) > 1 else None
    if camera is None or not all(_can_share(camera, frame) for frame in frames):
        return frames, None
    for _ in range(ROUNDS):
        stars = Matches.joined(
            [replace(m := _high(f.matches), vectors=m.vectors @ f.matrix) for f in frames if f.matches]
        )
        start = Attitude(best_rotation(stars.vectors, camera.unproject(stars.xy)))
        camera = refine(stars, camera, start).camera
        frames = [seen_by(camera, frame) for frame in frames]
    return frames, camera


def seen_by(camera: Camera | None, frame: LocalAttitude) -> LocalAttitude:
    """A frame fitted anew with a camera that is known but for its scale; as it is where it is another camera's."""
    if camera is None or frame.matches is None or not _can_share(camera, frame):
        return frame
    stars = _high(frame.matches)
    start = Attitude(best_rotation(stars.vectors, camera.unproject(stars.xy)))
    found = in_plain_axes(refine(stars, camera, start, distortion=False).attitude, camera)
    return replace(frame, matrix=found.matrix.T, covariance=covariance_of(found))


def _can_share(camera: Camera, frame: LocalAttitude) -> bool:
    other = frame.camera
    if other is None or frame.matches is None or len(frame.matches) < FEWEST:
        return False
    return (other.width, other.height) == (camera.width, camera.height) and same_optics(camera, other)


def same_optics(camera: Camera, other: Camera) -> bool:
    """Whether two frames may be of one camera, binned or not."""
    one, two = (c.width / plain_focal_px(c) for c in (camera, other))
    shapes_alike = abs(other.width * camera.height / (other.height * camera.width) - 1.0) < SAME_SCALE
    return camera.mirrored == other.mirrored and shapes_alike and abs(two / one - 1.0) < SAME_SCALE


def cropped(camera: Camera, other: Camera) -> bool:
    """Whether two frames of different size are as large on the sky a pixel, so that one may be cut out of the other."""
    sizes_differ = (other.width, other.height) != (camera.width, camera.height)
    alike = abs(plain_focal_px(other) / plain_focal_px(camera) - 1.0) < CUT_SCALE
    return sizes_differ and alike and camera.mirrored == other.mirrored


def _high(stars: Matches) -> Matches:
    """Those that stand high enough, or all when these are few."""
    high = stars.take(stars.vectors[:, 2] > LOWEST)
    return high if len(high) >= max(FEWEST, len(stars) // 3) else stars
