"""Options of a method: name, default, unit and range, told once, beside the field that holds them.

A method is a frozen dataclass whose fields are made by :func:`number`, :func:`integer`,
:func:`switch`, :func:`choice` and :func:`pair`; the command line and the window read them with
:func:`options_of` and hand values back through :func:`checked`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Literal

from app.core.errors import UsageError

Kind = Literal["number", "integer", "switch", "choice", "pair"]
WORDS = {"yes": True, "on": True, "true": True, "no": False, "off": False, "false": False}


@dataclass(frozen=True, slots=True)
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
        words = {"pair": "two numbers", "integer": "whole number", "number": "number"}
        what = words[self.kind]
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
            said = ",".join(map(str, value)) if isinstance(value, tuple) else value
            raise UsageError(f"{self.name} cannot be {said}; allowed: {self.range_text}.")
        return value

    def _allowed(self, value: Any) -> bool:
        if self.kind == "switch":
            return isinstance(value, bool)
        if self.kind == "choice":
            return value in self.choices
        parts = value if isinstance(value, tuple) else (value,)
        if len(parts) != (2 if self.kind == "pair" else 1):
            return False
        whole = self.kind == "integer"
        return all(_is_number(part, whole) and self.low <= part <= self.high for part in parts)


def _is_number(value: object, whole: bool) -> bool:
    if isinstance(value, bool):
        return False
    return isinstance(value, int) or (
        not whole and isinstance(value, float) and math.isfinite(value)
    )


def number(
    value: float | None, unit: str, low: float, high: float, text: str, none: str = ""
) -> Any:
    """A field that holds a number."""
    return _field(value, "number", unit, low, high, text, none=none)


def integer(value: int, unit: str, low: int, high: int, text: str) -> Any:
    """A field that holds a whole number."""
    return _field(value, "integer", unit, low, high, text)


def switch(value: bool, text: str) -> Any:
    """A field that is on or off."""
    return _field(value, "switch", "", 0, 1, text)


def choice(value: str, choices: Sequence[str], text: str) -> Any:
    """A field that holds one of several words."""
    return _field(value, "choice", "", 0, 0, text, choices=tuple(choices))


def pair(
    value: tuple[float, float] | None, unit: str, low: float, high: float, text: str,
    none: str = "",
) -> Any:  # fmt: skip
    """A field that holds two numbers."""
    return _field(value, "pair", unit, low, high, text, none=none)


def _field(
    value: Any, kind: Kind, unit: str, low: float, high: float, text: str,
    choices: tuple[str, ...] = (), none: str = "",
) -> Any:  # fmt: skip
    told = Option("", value, kind, unit, low, high, text, choices, none)
    return field(default=value, metadata={"option": told})


def options_of(method: type) -> tuple[Option, ...]:
    """The options of a method's class, in their order; () when it has none."""
    if not is_dataclass(method):
        return ()
    told = ((f.name, f.metadata.get("option")) for f in fields(method))
    return tuple(_named(name, option) for name, option in told if option is not None)


def _named(name: str, option: Option) -> Option:
    return Option(
        name, option.value, option.kind, option.unit, option.low, option.high, option.text,
        option.choices, option.none,
    )  # fmt: skip


def checked(method: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """``values`` by name, each of them allowed; texts are read as if typed.

    Raises
    ------
    UsageError
        There is no such option, or its value is not allowed.

    """
    known = {option.name: option for option in options_of(method)}
    for name in values:
        if name not in known:
            there = f"there are {', '.join(known)}" if known else "there are none"
            raise UsageError(f"There is no option {name}; {there}.")
    return {
        name: known[name].parse(value) if isinstance(value, str) else known[name].check(value)
        for name, value in values.items()
    }
