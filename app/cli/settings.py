"""``--set NAME=VALUE`` and ``--methods``: the options of methods, detectors and attitudes."""

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from app.core.errors import UsageError

KINDS = ("method", "detector", "attitude")


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add the options that change a method, and the list of what can be changed."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="settings",
        metavar="NAME=VALUE",
        help="an option of the method; detector.NAME and attitude.NAME are of the other two",
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
        if not equals or not name.strip():
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

    lines = []
    for kind in KINDS:
        prefix = "" if kind == "method" else f"{kind}."
        for name, target in _registry(kind).items():
            found = _class(target)
            paper = getattr(found, "paper", "")
            lines.append(f"--{kind} {name}{f'   ({paper})' if paper else ''}")
            for option in options_of(found):
                what = f"{option.text} [{option.range_text}]"
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
