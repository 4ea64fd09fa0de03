"""``kochab`` and ``python -m app``: the window, or the command that was named."""

import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from app.core.solution import Solution
    from app.simulate.fields import FieldPlan
    from app.simulate.practice import Practice
    from app.workflows.laboratory import FieldWish, TrueField, TruePicture
    from app.workflows.live_update import LiveUpdate


def main(argv: Sequence[str] | None = None) -> int:
    """Open the window for nothing or for a file; leave all else to the command line.

    Returns the exit code: 2 when the window cannot open, with one sentence that says what to do.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if not sys.warnoptions:  # python -W shows them; what a person should know is said in sentences
        warnings.simplefilter("ignore")
    try:
        if not arguments or _is_file(arguments):
            return _window(arguments)
        from app.cli.main import main as cli_main

        return cli_main(arguments)
    except KeyboardInterrupt:  # while still starting
        return 130


def _is_file(arguments: list[str]) -> bool:
    """Whether the one argument is a file to open rather than a command of the same name."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        return False
    from app.cli.main import COMMANDS

    name = arguments[0]
    return name not in COMMANDS and (Path(name).exists() or bool(Path(name).suffix))


def _window(paths: list[str]) -> int:
    from app.ui import display

    trouble = display.trouble()
    if trouble is None:
        try:
            from app.ui.application import run
            from app.ui.wiring import Wiring
        except ImportError as error:
            trouble = display.missing(error)
    if trouble is not None:
        print(f"kochab: {trouble}", file=sys.stderr)
        return 2
    wiring = Wiring(_to_json, _practise, _simulated_field, _to_record, _simulated_picture)
    return run(paths, wiring=wiring)


def _to_json(file: str, solution: "Solution") -> str:
    from app.cli.output import as_json, to_line

    return to_line(as_json(file, solution))


def _to_record(update: "LiveUpdate") -> dict[str, Any]:
    from app.cli.live_output import finite_json

    return finite_json(update)


def _practise(**wishes: Any) -> "Practice":
    """A simulated telescope, see :func:`app.simulate.practice.practise` for the wishes."""
    from app.simulate.practice import practise

    return practise(**wishes)


def _simulated_field(wish: "FieldWish", seeds: "Sequence[int]") -> "TrueField":
    """A star field for the Laboratory, from the room that the window does not know."""
    import numpy as np

    from app.simulate.fields import random_field
    from app.sky import open_catalogue

    return random_field(open_catalogue(), np.random.default_rng(list(seeds)), _plan(wish))


def _simulated_picture(wish: "FieldWish", seeds: "Sequence[int]") -> "TruePicture":
    """The same as a picture."""
    import numpy as np

    from app.simulate.pictures import random_picture
    from app.sky import open_catalogue

    return random_picture(open_catalogue(), np.random.default_rng(list(seeds)), _plan(wish))


def _plan(wish: "FieldWish") -> "FieldPlan":
    from app.simulate.fields import FieldPlan

    return FieldPlan(
        wish.fov_deg, wish.size_px, wish.noise_px, wish.missing, wish.false, brightest=wish.stars
    )


if __name__ == "__main__":
    sys.exit(main())
