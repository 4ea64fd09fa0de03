"""Files that are written beside an answer; each returns sentences about what could not be."""

from app.core.frame import Frame
from app.core.solution import Solution


def write_wcs_beside(file: str, solution: Solution) -> list[str]:
    """Write ``FILE.wcs``."""
    return write_wcs_to(f"{file}.wcs", solution)


def write_wcs_to(target: str, solution: Solution) -> list[str]:
    """Write a ``.wcs`` file."""
    from app.solve.wcs import write_wcs

    try:
        write_wcs(solution, target)
    except OSError as error:
        return [_sentence(target, error)]
    return []


def write_picture(target: str, frame: Frame, solution: Solution) -> list[str]:
    """Write the picture with its stars named, a PNG."""
    from app.frames.export import annotate

    try:
        annotate(frame, solution, target)
    except OSError as error:
        return [_sentence(target, error)]
    return []


def _sentence(target: str, error: OSError) -> str:
    return f"{target} cannot be written: {error.strerror or error}."
