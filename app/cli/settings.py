"""``--set NAME=VALUE`` and ``--methods``: the options of methods, detectors and attitudes."""

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from app.core.errors import UsageError

KINDS = ("method", "detector", "attitude")
DEFAULTS = ("patterns", "auto")
NEEDS = (
    "Every method but patterns needs the scale, from --fov, --scale or the frame's header;"
    " predict needs the place as well."
)


OF_METHOD = "an option of the method; detector.NAME and attitude.NAME are of the other two"
OF_DETECTOR = "an option of the detector"


def add_settings(parser: argparse.ArgumentParser, text: str = OF_METHOD) -> None:
    """Add the options that change a method, and the list of what can be changed."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="settings",
        metavar="NAME=VALUE",
        help=f"{text}; may be repeated",
    )
    parser.add_argument(
        "--methods",
        action=_List,
        nargs=0,
        help="list methods, detectors and attitudes with their options, units, ranges and papers",
    )


def settings_of(
    settings: Sequence[str], method: str, detector: str, attitude: str | None
) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """What ``--set`` says of the method, of the detector and of the attitude.

    Raises
    ------
    UsageError
        There is no such option, or it cannot have that value.

    """
    said: dict[str, dict[str, str]] = {kind: {} for kind in KINDS}
    for text in settings:
        name, equals, value = text.partition("=")
        kind, dot, option = name.strip().partition(".")
        if not equals or not (option if dot else kind):
            raise UsageError(f"--set {text} is not NAME=VALUE.")
        if dot and kind in said:
            said[kind][option] = value
        else:
            said["method"][name.strip()] = value
    names = {"method": method, "detector": detector, "attitude": attitude}
    if said["attitude"] and attitude is None:
        raise UsageError("--set attitude.NAME needs --attitude.")
    made = [_checked(kind, names[kind], said[kind]) for kind in KINDS]
    return made[0], made[1], made[2]


def detector_settings_of(settings: Sequence[str], detector: str) -> dict[str, Any]:
    """What ``--set`` says of the detector where there is nothing else to set.

    Raises
    ------
    UsageError
        There is no such option, or it cannot have that value.

    """
    named = (text if text.startswith("detector.") else f"detector.{text}" for text in settings)
    return settings_of(list(named), "", detector, None)[1]


def _checked(kind: str, name: str | None, said: Mapping[str, str]) -> dict[str, Any]:
    from app.core.options import checked

    if not said or name is None:
        return {}
    try:
        return checked(_class(_registry(kind)[name]), said)
    except UsageError as error:
        raise UsageError(f"{kind.capitalize()} {name}: {error}") from error


def _registry(kind: str) -> Mapping[str, str]:
    from app.attitude import ESTIMATORS
    from app.detect import DETECTORS
    from app.identify import IDENTIFIERS

    return {"method": IDENTIFIERS, "detector": DETECTORS, "attitude": ESTIMATORS}[kind]


def _class(target: str) -> type:
    from importlib import import_module

    module, _, name = target.partition(":")
    found: type = getattr(import_module(module), name)
    return found


def everything() -> str:
    """All registered methods, detectors and attitudes, with what can be set about each."""
    from app.core.options import options_of

    lines = [NEEDS]
    for kind in KINDS:
        prefix = "" if kind == "method" else f"{kind}."
        for name, target in _registry(kind).items():
            found = _class(target)
            paper = getattr(found, "paper", "")
            about = "the default" if name in DEFAULTS else paper
            lines.append(f"--{kind} {name}{f'   ({about})' if about else ''}")
            for option in options_of(found):
                absent = f": {option.none}" if option.none else ""
                what = f"{option.text} [{option.range_text}{absent}]"
                lines.append(f"    {prefix}{option.name}={option.value_text}   {what}")
    return "\n".join(lines)


class _List(argparse.Action):
    """Print the list and leave, as ``--help`` does."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        """Do it."""
        print(everything())
        parser.exit()
