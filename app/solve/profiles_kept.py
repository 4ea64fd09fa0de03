"""Camera profiles on disk: one JSON file for each camera, lens and size of frame."""

import hashlib
import json
import os
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from app.core.camera import Camera
from app.core.errors import KochabError
from app.frames.whole_file import write_whole
from app.solve.profiles import TERMS, Profile

FORMAT = 1


def profile_folder() -> Path:
    """Where profiles lie: below ``KOCHAB_CONFIG``, or in the user's own configuration."""
    from platformdirs import user_config_path

    told = os.environ.get("KOCHAB_CONFIG")
    root = Path(told) if told else user_config_path("kochab", appauthor=False)
    return root / "cameras"


def profile_path(name: str, width: int, height: int, folder: Path | None = None) -> Path:
    """The file of a camera of that name with frames of that size."""
    plain = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower()[:40] or "camera"
    mark = hashlib.sha256(name.encode("utf-8")).hexdigest()[:8]
    return (folder or profile_folder()) / f"{plain}-{width}x{height}-{mark}.json"


def keep(profile: Profile, folder: Path | None = None) -> Path:
    """Write a profile, whole or not at all.

    Raises
    ------
    KochabError
        It cannot be written.

    """
    camera = profile.camera
    path = profile_path(profile.name, camera.width, camera.height, folder)
    told: dict[str, Any] = {
        "format": FORMAT, "name": profile.name, "frames": profile.frames,
        "camera": asdict(camera), "sigma": profile.sigma, "terms": list(TERMS),
        "information": profile.information.tolist(),
    }  # fmt: skip
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(told, indent=1))
    except OSError as error:
        raise KochabError(
            f"The camera profile cannot be kept in {path.parent}: {error.strerror}."
        ) from error
    return path


def recalled(name: str, width: int, height: int, folder: Path | None = None) -> Profile | None:
    """The profile kept for a camera, or None when there is none.

    Raises
    ------
    KochabError
        There is a file, and it cannot be read as one.

    """
    path = profile_path(name, width, height, folder)
    if not path.exists():
        return None
    try:
        told = json.loads(path.read_text("utf-8"))
        information = np.array(told["information"], dtype=np.float64)
        camera = Camera(**told["camera"])
        if told["terms"] != list(TERMS) or information.shape != (len(TERMS), len(TERMS)):
            raise ValueError("other terms")
        if (camera.width, camera.height) != (width, height):
            raise ValueError("another size")
        np.linalg.cholesky(information)
        return Profile(str(told["name"]), camera, information, int(told["frames"]))
    except (OSError, ValueError, KeyError, TypeError, np.linalg.LinAlgError) as error:
        raise KochabError(f"{path} is no camera profile; delete it to begin anew.") from error


def every(folder: Path | None = None) -> list[Path]:
    """The files of all kept profiles, by name."""
    return sorted((folder or profile_folder()).glob("*.json"))
