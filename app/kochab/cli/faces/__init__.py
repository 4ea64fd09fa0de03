"""Other programs' command lines, each answered as the original answers.

A face is chosen by the name that Kochab is called by (a link or a copy named ``astap_cli``), or by the same word as the
first argument. ``kochab -f FILE ...`` is ASTAP's as well.
"""

import os

TYPE_CHECKING = False  # importing typing takes a third of a handed over command's time
if TYPE_CHECKING:
    from collections.abc import Sequence

FACES = {
    "astap": "kochab.cli.faces.astap:run",
    "astap_cli": "kochab.cli.faces.astap:run",
    "solve-field": "kochab.cli.faces.solve_field:run",
    "watney-solve": "kochab.cli.faces.watney:run",
    "platesolve2": "kochab.cli.faces.platesolve:run_2",
    "platesolve3": "kochab.cli.faces.platesolve:run_3",
}
"""By the original's name, what takes its arguments and returns its exit code."""


def named_face(program: str) -> str | None:
    """The face that a program's path names: ``astap_cli`` for ``/opt/bin/astap_cli`` and ``astap_cli.exe``."""
    name = os.path.basename(program).lower().removesuffix(".exe")
    program, _, version = name.rpartition(".")
    if program in ("platesolve2", "platesolve3") and version.isdecimal():  # PlaneWave's have a version in their names
        name = program
    return name if name in FACES else None


def face_of(arguments: "Sequence[str]") -> str | None:
    """The face that a command line is for; None for Kochab's own commands."""
    if not arguments:
        return None
    if arguments[0] in FACES:
        return arguments[0]
    # ASTAP's words have one dash.
    return "astap" if "-f" in arguments and arguments[0][:1] == "-" and "a" <= arguments[0][1:2] <= "z" else None
