"""``kochab`` and ``python -m app``: the window, or the command that was named."""

import atexit
import gc
import os
import sys

from kochab.cli.faces import face_of, named_face
from kochab.cli.warm import is_for_worker, is_short

TYPE_CHECKING = False  # as in `kochab.cli.faces`
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from kochab.server.phone_page import PhonePage
    from kochab.server.telescope.offer import Offer
    from kochab.simulate.practice import PracticeNight
    from kochab.workflows.live.update import LiveUpdate
    from kochab.workflows.telescope.offered import OfferedTelescope


def main(argv: "Sequence[str] | None" = None) -> int:
    """Open the window for nothing or for files, with ``--language de`` in German; leave all else to the commands.

    Returns the exit code: 2 when the window cannot open, with one sentence that says what to do.
    """
    arguments = _own_arguments() if argv is None else list(argv)
    # Before anything heavy is imported and before the rest is parsed: the mount may be moving towards something.
    if arguments[:2] == ["mount", "stop"]:
        from kochab.gear.quick_stop import send_first_stop

        send_first_stop(arguments)
    # Before as well: what a worker does costs no import here.
    if argv is None and is_for_worker(arguments):
        from kochab.server.hand_over import hand_over

        if (code := hand_over(arguments)) is not None:
            return code
    if argv is None and is_short(arguments):
        gc.disable()  # what is imported is no rubbish, and a frame leaves little: a batch collects again
    # Our matrices are small: threads of the linear algebra would cost a third of a short command, and gain nothing.
    if "OMP_NUM_THREADS" not in os.environ:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if getattr(sys, "frozen", False):
        from kochab.frames.sandbox import support_frozen

        support_frozen(arguments)
    if not sys.warnoptions:  # python -W shows them; what a person should know is said in sentences
        import warnings

        warnings.simplefilter("ignore")
    spoken = arguments[1] if arguments[:1] == ["--language"] and len(arguments) > 1 else ""
    arguments = arguments[2:] if spoken else arguments
    try:
        from kochab.cli.process import make_ready
        from kochab.gear.journal import open_journal

        make_ready()

        to_window = not arguments or (face_of(arguments) is None and _are_files(arguments))
        open_journal(terminal=not to_window)
        if to_window:
            return _window(arguments, spoken)
        from kochab.cli.main import main as cli_main

        return cli_main(arguments)
    except KeyboardInterrupt:  # while still starting
        return 130


def run_process() -> int:
    """Run :func:`main` as the whole process: a short command ends at once.

    Taking the interpreter apart would cost a twentieth of its time; what was registered for the end is done.
    """
    code = main()
    watched = sys.getprofile() or sys.gettrace()  # a profiler wants its own end
    if is_short(_own_arguments()) and not watched:
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            try:  # contextlib's suppress would take a tenth of a handed over command's time
                if stream is not None:
                    stream.flush()
            except (OSError, ValueError):  # said where it was written
                pass
        os._exit(code)
    return code


def _own_arguments() -> list[str]:
    """What we were called with; called by another program's name, that name comes first."""
    face = named_face(sys.argv[0])
    return [*([face] if face else []), *sys.argv[1:]]


def _are_files(arguments: list[str]) -> bool:
    """Whether all arguments are files and folders to open, and the first is no command of the same name."""
    if any(argument.startswith("-") for argument in arguments):
        return False
    from pathlib import Path

    from kochab.cli.main import COMMANDS

    # A name with an ending is a file even if there is none: the window then says what is wrong with it.
    return arguments[0] not in COMMANDS and all(Path(name).exists() or Path(name).suffix for name in arguments)


def _window(paths: list[str], language: str = "") -> int:
    from kochab.window import display_check as display

    trouble = display.trouble()
    if trouble is None:
        try:
            from kochab.window.application import run
            from kochab.workflows.session.wiring import Wiring
        except ImportError as error:
            trouble = display.missing(error)
    if trouble is not None:
        print(f"kochab: {trouble}", file=sys.stderr)
        return 2
    wiring = Wiring(_practise, _to_record, _phone_page, _offer_telescope)
    return run(paths, wiring, language)


def _to_record(update: "LiveUpdate") -> "dict[str, Any]":
    from kochab.cli.live import finite_json

    return finite_json(update)


def _phone_page() -> "PhonePage":
    from kochab.server.phone_page import PhonePage

    return PhonePage()


def _offer_telescope(telescope: "OfferedTelescope", lan: bool, stellarium_remote: str | None) -> "Offer":
    from kochab.server.telescope.offer import Offer

    return Offer(telescope, {}, lan, stellarium_remote)


def _practise(**wishes: "Any") -> "PracticeNight":
    """A simulated telescope, see :func:`kochab.simulate.practice.practise` for the wishes."""
    from kochab.simulate.practice import practise

    return practise(**wishes)


if __name__ == "__main__":
    sys.exit(run_process())
