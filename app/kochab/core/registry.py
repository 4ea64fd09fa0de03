"""Methods, detectors, drivers and the like by name, and their options with default, unit and range.

A method is a frozen dataclass whose fields are made by :func:`number`, :func:`integer`,
:func:`switch`, :func:`choice` and :func:`pair`; the command line and the window read them with
:func:`options_of` and hand values back through :func:`checked`.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, fields, is_dataclass, replace
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from kochab.core.errors import UsageError
from kochab.core.values import frozen

if TYPE_CHECKING:
    import logging

T = TypeVar("T")
Kind = Literal["number", "integer", "switch", "choice", "pair"]
WORDS = {"yes": True, "on": True, "true": True, "no": False, "off": False, "false": False}


@frozen
class Option:
    """One thing a person may choose about a method.

    ``value`` is the default and ``unit`` its unit ("" for none); numbers lie within ``low`` and
    ``high``, both included, as do both numbers of a pair. ``choices`` are the words of a choice.
    ``none`` says what an absent value means; it is "" where a value is needed.
    """

    name: str
    value: Any
    kind: Kind
    unit: str
    low: float
    high: float
    text: str
    choices: tuple[str, ...] = ()
    none: str = ""

    @property
    def range_text(self) -> str:
        """What is allowed, in words."""
        if self.kind == "switch":
            return "on or off"
        if self.kind == "choice":
            return " or ".join(self.choices)
        what = {"pair": "two numbers", "integer": "whole number", "number": "number"}[self.kind]
        span = f"{what} from {self.low:g} to {self.high:g}{' ' + self.unit if self.unit else ''}"
        return f"{span}, or none" if self.none else span

    @property
    def value_text(self) -> str:
        """The default as it would be typed."""
        if self.value is None:
            return "none"
        if self.kind == "pair":
            return ",".join(f"{part:g}" for part in self.value)
        if self.kind == "switch":
            return "on" if self.value else "off"
        return f"{self.value:g}" if self.kind == "number" else str(self.value)

    def parse(self, text: str) -> Any:
        """The value that ``text`` says; UsageError with one sentence when it says none allowed."""
        word = text.strip()
        if self.none and word.lower() == "none":
            return None
        if self.kind == "switch":
            return self.check(WORDS.get(word.lower(), word))
        if self.kind == "choice":
            return self.check(word)
        try:
            numbers = [float(part) for part in word.split(",")]
        except ValueError:
            numbers = []
        if self.kind == "integer" and len(numbers) == 1 and numbers[0].is_integer():
            return self.check(int(numbers[0]))
        return self.check(numbers[0] if len(numbers) == 1 else tuple(numbers))

    def check(self, value: Any) -> Any:
        """``value`` itself when it is allowed, else UsageError."""
        if value is None and self.none:
            return None
        if not self._allowed(value):
            text = ",".join(map(str, value)) if isinstance(value, tuple) else value
            raise UsageError(
                "{name} cannot be {text}; allowed: {range}.", name=self.name, text=text, range=self.range_text
            )
        return value

    def _allowed(self, value: Any) -> bool:
        if self.kind == "switch":
            return isinstance(value, bool)
        if self.kind == "choice":
            return value in self.choices
        parts = value if isinstance(value, tuple) else (value,)
        if len(parts) != (2 if self.kind == "pair" else 1):
            return False
        return all(_is_number(part, self.kind == "integer") and self.low <= part <= self.high for part in parts)


def _is_number(value: object, whole: bool) -> bool:
    if isinstance(value, bool):  # a bool is an int to Python; True is not 1 here
        return False
    return isinstance(value, int) or (not whole and isinstance(value, float) and math.isfinite(value))


def number(value: float | None, unit: str, low: float, high: float, text: str, none: str = "") -> Any:
    """A field that holds a number.

    Parameters
    ----------
    value : float or None
        The default; None where the method chooses by itself.
    unit : str
        Shown after the value, as ``px``; empty for none.
    low, high : float
        Least and largest value allowed.
    text : str
        What the option does, in a few words.
    none : str
        What None means, in words; empty where None is not allowed.
    """
    return _field(value, "number", unit, low, high, text, none=none)


def integer(value: int, unit: str, low: int, high: int, text: str) -> Any:
    """A field that holds a whole number.

    Parameters
    ----------
    value : int
        The default.
    unit : str
        Shown after the value; empty for none.
    low, high : int
        Least and largest value allowed.
    text : str
        What the option does, in a few words.
    """
    return _field(value, "integer", unit, low, high, text)


def switch(value: bool, text: str) -> Any:
    """A field that is on or off."""
    return _field(value, "switch", "", 0, 1, text)


def choice(value: str, choices: Sequence[str], text: str) -> Any:
    """A field that holds one of several words."""
    return _field(value, "choice", "", 0, 0, text, choices=tuple(choices))


def pair(value: tuple[float, float] | None, unit: str, low: float, high: float, text: str, none: str = "") -> Any:
    """A field that holds two numbers.

    Parameters
    ----------
    value : tuple[float, float] or None
        The default; None where the method chooses by itself.
    unit : str
        Shown after the values; empty for none.
    low, high : float
        Least and largest value allowed of each.
    text : str
        What the option does, in a few words.
    none : str
        What None means, in words; empty where None is not allowed.
    """
    return _field(value, "pair", unit, low, high, text, none=none)


def _field(value: Any, kind: Kind, *limits: Any, **more: Any) -> Any:
    return field(default=value, metadata={"option": Option("", value, kind, *limits, **more)})


def options_of(method: type) -> tuple[Option, ...]:
    """The options of a method's class, in their order; () when it has none."""
    if not is_dataclass(method):
        return ()
    found = ((f.name, f.metadata.get("option")) for f in fields(method))
    return tuple(replace(option, name=name) for name, option in found if option is not None)


def checked(method: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """``values`` by name, each of them allowed; texts are read as if typed.

    Raises `UsageError` when there is no such option, or when its value is not allowed.
    """
    known = {option.name: option for option in options_of(method)}
    for name in values:
        if name not in known:
            there = f"there are {', '.join(known)}" if known else "there are none"
            raise UsageError("There is no option {name}; {there}.", name=name, there=there)
    return {
        name: known[name].parse(value) if isinstance(value, str) else known[name].check(value)
        for name, value in values.items()
    }


# -- Registries: name -> "module:Class", imported when used ------------------------------------


class Registry(Mapping[str, str], Generic[T]):
    """Things of one kind by name, each as ``"module:Class"``, which is imported when it is used.

    ``own`` are the program's, the default first. Other packages, and the program's own wing of published methods, add
    theirs as entry points of ``group``. Installed packages are searched only for a name that is not in ``own``, and
    when all names are listed. A package that cannot be used costs one warning in the log.
    """

    def __init__(self, kind: str, group: str, own: Mapping[str, str]) -> None:
        self.kind, self.group, self.own = kind, group, own
        self._others: dict[str, str] | None = None

    def __getitem__(self, name: str) -> str:
        return self.own[name] if name in self.own else self.others()[name]

    def __iter__(self) -> Iterator[str]:
        return iter([*self.own, *self.others()])

    def __len__(self) -> int:
        return len(self.own) + len(self.others())

    def others(self) -> Mapping[str, str]:
        """What entry points add, sorted by name; the first package on the path wins."""
        if self._others is None:
            found: dict[str, str] = {}
            for name, target in entry_points_of(self.group):
                if not re.fullmatch(r"[\w.]+:\w+", target):
                    _log().warning("The %s %s is left out: %r is not module:Class.", self.kind, name, target)
                elif name in self.own or found.get(name, target) != target:
                    _log().warning("The %s %s of %s is left out: the name is taken.", self.kind, name, target)
                else:
                    found[name] = target
            self._others = dict(sorted(found.items()))
        return self._others

    def check(self, name: str) -> None:
        """Raise :class:`UsageError`, which lists the names there are, when ``name`` is none of them."""
        if name not in self:
            raise UsageError(
                "There is no {kind} '{name}'; choose one of {value}.", kind=self.kind, name=name, value=", ".join(self)
            )

    def load(self, name: str) -> Any:
        """The class, or the function, registered as ``name``.

        Raises `UsageError` when there is none, or when the package that registered it cannot be imported.
        """
        self.check(name)
        try:
            return resolve_name(self[name])
        except Exception as error:  # another package's module may raise anything when imported
            if name in self.own:
                raise
            _log().debug("%s", self[name], exc_info=True)
            cause = f"{type(error).__name__}: {error}"
            raise UsageError(
                "The {kind} '{name}' ({value}) cannot be loaded: {cause}",
                kind=self.kind,
                name=name,
                value=self[name],
                cause=cause,
            ) from error

    def loaded(self) -> dict[str, Any]:
        """Every class by its name; one that cannot be loaded is left out with a warning."""
        found = {}
        for name in self:
            try:
                found[name] = self.load(name)
            except UsageError as error:
                _log().warning("%s", error)
        return found

    def make(self, name: str | None = None, /, **options: Any) -> T:
        """An instance of the class ``name``, None for the default, made with ``options``."""
        made: T = self.load(next(iter(self.own)) if name is None else name)(**options)
        return made


def _log() -> "logging.Logger":
    import logging  # 10 ms of the start of a program that as a rule has nothing to warn of

    return logging.getLogger(__name__)


def entry_points_of(group: str) -> Iterator[tuple[str, str]]:
    """Names and targets that packages on the path register under ``group``.

    In a checkout those of the program itself are read from its ``pyproject.toml``: it need not be
    installed, and what an older installation wrote down does not count.
    """
    import tomllib
    from importlib.metadata import distributions

    project: dict[str, Any] = {}
    file = Path(__file__).resolve().parents[3] / "pyproject.toml"
    if file.is_file():
        project = tomllib.loads(file.read_text(encoding="utf-8")).get("project", {})
        # Its own distribution is left out below: an older installation may name modules that are gone.
        yield from project.get("entry-points", {}).get(group, {}).items()
    for package in distributions():
        try:
            found = [e for e in package.entry_points if e.group == group]
            checkout = bool(found) and package.metadata["Name"] == project.get("name")
        except (OSError, TypeError, ValueError) as error:  # a damaged entry_points.txt
            _log().warning("The entry points of an installed package cannot be read: %s", error)
            continue
        if not checkout:
            yield from ((entry.name, entry.value) for entry in found)
