"""Values: dataclasses with slots whose methods are made once for all of them, but for the constructors.

`dataclasses.dataclass` writes and compiles every method of every class: 1.4 ms of processor time for one that is frozen
and has six fields, where this takes 0.15 ms. A command that solves a frame makes 63 of them. What the standard library
does with a dataclass (`fields`, `replace`, `asdict`, `copy`, `pickle`, `match`) it does with these, which are such.
"""

from collections.abc import Callable, Iterable
from dataclasses import MISSING, Field, FrozenInstanceError, dataclass, field, fields
from operator import attrgetter
from reprlib import recursive_repr
from typing import Any, NoReturn, TypeVar, dataclass_transform, overload

T = TypeVar("T")


@overload
def frozen(cls: type[T], /) -> type[T]: ...
@overload
def frozen(*, eq: bool = True) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: type[T] | None = None, /, *, eq: bool = True) -> type[T] | Callable[[type[T]], type[T]]:
    """Make a class a dataclass with slots whose fields cannot be set; with ``eq=False`` none equals another."""
    return _made(cls, eq, True) if cls is not None else lambda cls: _made(cls, eq, True)


@overload
def mutable(cls: type[T], /) -> type[T]: ...
@overload
def mutable(*, eq: bool = True) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform(field_specifiers=(field,))
def mutable(cls: type[T] | None = None, /, *, eq: bool = True) -> type[T] | Callable[[type[T]], type[T]]:
    """Make a class a dataclass with slots whose fields can be set; with ``eq=False`` none equals another."""
    return _made(cls, eq, False) if cls is not None else lambda cls: _made(cls, eq, False)


def _made(plain: type[T], eq: bool, is_frozen: bool) -> type[T]:
    own = set(vars(plain))
    made: Any = dataclass(init=False, repr=False, eq=False, slots=True)(plain)
    methods: dict[str, Any] = {"__repr__": _repr}
    if eq:
        methods |= {"__eq__": _eq, "__hash__": _hash if is_frozen else None}
        made._compared = _getter(one.name for one in fields(made) if one.compare)
        made._hashed = _getter(one.name for one in fields(made) if (one.compare if one.hash is None else one.hash))
    if is_frozen:
        methods |= {"__setattr__": _refuse, "__delattr__": _refuse, "__getstate__": _state, "__setstate__": _restore}
    for name, method in methods.items():
        if name not in own:
            setattr(made, name, method)
    made.__init__ = _constructor(made, is_frozen)
    return made  # type: ignore[no-any-return]


def _constructor(cls: Any, is_frozen: bool) -> Callable[..., None]:
    """``__init__``, the one method that has to be written for each class."""
    own = fields(cls)
    names: dict[str, Any] = {"FRESH": _FRESH}
    body = []
    for one in own:
        names |= {f"default_{one.name}": one.default, f"make_{one.name}": one.default_factory}
        value = one.name if one.init else f"default_{one.name}"
        if one.default_factory is not MISSING:
            value = f"make_{one.name}()" + (f" if {value} is FRESH else {value}" if one.init else "")
        elif not one.init and one.default is MISSING:
            continue
        if is_frozen:  # past `__setattr__`, by the slot itself
            names[f"set_{one.name}"] = getattr(cls, one.name).__set__
            body.append(f"set_{one.name}(self, {value})")
        else:
            body.append(f"self.{one.name} = {value}")
    if hasattr(cls, "__post_init__"):
        body.append("self.__post_init__()")
    by_place = [_argument(one) for one in own if one.init and not one.kw_only]
    by_name = [_argument(one) for one in own if one.init and one.kw_only]
    arguments = ", ".join(["self", *by_place, *(["*", *by_name] if by_name else [])])
    exec(f"def __init__({arguments}):\n " + "\n ".join(body or ["pass"]), names)
    made: Callable[..., None] = names["__init__"]
    made.__module__, made.__qualname__ = cls.__module__, f"{cls.__qualname__}.__init__"
    made.__annotations__ = {one.name: one.type for one in own if one.init} | {"return": None}
    return made


def _argument(one: "Field[Any]") -> str:
    if one.default_factory is not MISSING:
        return f"{one.name}=FRESH"
    return one.name if one.default is MISSING else f"{one.name}=default_{one.name}"


class _Fresh:
    def __repr__(self) -> str:
        return "<factory>"


_FRESH = _Fresh()


@recursive_repr()
def _repr(self: Any) -> str:
    shown = (f"{one.name}={getattr(self, one.name)!r}" for one in fields(self) if one.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _getter(names: Iterable[str]) -> "attrgetter[Any]":
    return attrgetter(*(list(names) or ["__class__"]))


def _eq(self: Any, other: Any) -> bool:
    return bool(self._compared(self) == other._compared(other)) if type(other) is type(self) else NotImplemented


def _hash(self: Any) -> int:
    return hash(self._hashed(self))


def _refuse(self: Any, name: str, value: object = None) -> NoReturn:
    raise FrozenInstanceError(name)


def _state(self: Any) -> list[Any]:
    return [getattr(self, one.name) for one in fields(self)]


def _restore(self: Any, state: list[Any]) -> None:
    for one, value in zip(fields(self), state, strict=True):
        object.__setattr__(self, one.name, value)
