"""cedar-solve on a simulated field, for the bench alone."""

import contextlib
import io
import logging
import math

import numpy as np

from app.core.attitude import unit_vectors
from app.simulate.fields import Field


class CedarSolve:
    """The public solver of that name with its own default database; raises ImportError."""

    def __init__(self) -> None:
        # its 0.5.1 asks numpy for a module that numpy 2 no longer lends
        if not hasattr(np, "math"):
            setattr(np, "math", math)  # noqa: B010
        logging.disable(logging.INFO)
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                from tetra3 import Tetra3

                self.engine = Tetra3("default_database")
        finally:
            logging.disable(logging.NOTSET)

    def solve(self, truth: Field) -> tuple[bool, bool]:
        """Whether its answer is right, and whether it gave one, within five seconds.

        It does not know mirrored frames: they are unmirrored for it.
        """
        d, n = truth.detections, truth.camera.width
        xy = d.xy.copy()
        if truth.camera.mirrored:
            xy[:, 0] = n - 1 - xy[:, 0]
        with contextlib.redirect_stdout(io.StringIO()):
            said = self.engine.solve_from_centroids(
                xy[:, ::-1] + 0.5, (n, n), solve_timeout=5000, return_matches=False
            )
        if said.get("RA") is None:
            return False, False
        sky = unit_vectors(float(said["RA"]), float(said["Dec"]))
        off_px = float(np.linalg.norm(sky - truth.attitude.boresight)) * truth.camera.focal_px
        return off_px < 10.0, True
