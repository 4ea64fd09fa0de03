"""Values behave as the standard library's dataclasses do: each is made by both, and what both say is compared."""

import copy
import inspect
import pickle
from dataclasses import FrozenInstanceError, asdict, dataclass, field, fields, replace
from typing import ClassVar

import pytest

from kochab.core.values import frozen, mutable


def star(decorate):
    """A class with fields of every kind."""

    @decorate
    class Star:
        """A star."""

        kind: ClassVar[str] = "star"
        place: tuple[float, float]
        name: str = "Kochab"
        lines: list[str] = field(default_factory=list)
        weight: float = field(default=1.0, compare=False, repr=False)
        options: dict[str, int] = field(default_factory=dict, hash=False, kw_only=True)
        order: int = field(default=7, kw_only=True)
        seen: int = field(default=3, init=False)
        parts: dict[str, int] = field(default_factory=dict, init=False)

        def __post_init__(self):
            if not self.name:
                raise ValueError(self.order)

    return Star


PAIRS = [
    pytest.param(frozen, dataclass(frozen=True, slots=True), id="frozen"),
    pytest.param(mutable, dataclass(slots=True), id="mutable"),
    pytest.param(frozen(eq=False), dataclass(frozen=True, slots=True, eq=False), id="frozen, by identity"),
    pytest.param(mutable(eq=False), dataclass(slots=True, eq=False), id="mutable, by identity"),
]
MADE = [((1.0, 2.0),), ((1.0, 2.0), "Polaris", ["a"], 3.0)]


@pytest.mark.parametrize(("ours", "theirs"), PAIRS)
@pytest.mark.parametrize("arguments", MADE)
def test_values_answer_as_the_standard_librarys_dataclasses(ours, theirs, arguments):
    a, b = (star(one)(*arguments, order=2) for one in (ours, theirs))
    assert repr(a) == repr(b)
    assert [str(one) for one in fields(type(a))] == [str(one) for one in fields(type(b))]
    assert str(inspect.signature(type(a))) == str(inspect.signature(type(b)))
    assert type(a).__match_args__ == type(b).__match_args__
    assert type(a).__slots__ == type(b).__slots__
    assert not hasattr(a, "__dict__")
    assert (a == copy.copy(a)) == (b == copy.copy(b))
    assert (a == type(a)(*arguments)) == (b == type(b)(*arguments))
    assert a != b
    assert a.lines is not star(ours)((0.0, 0.0)).lines


@pytest.mark.parametrize(("ours", "theirs"), PAIRS)
def test_values_refuse_what_the_standard_librarys_dataclasses_refuse(ours, theirs):
    for kwargs in ({}, {"place": 1, "nothing": 2}, {"place": 1, "seen": 2}, {"place": 1, "name": ""}):
        errors = []
        for one in (ours, theirs):
            with pytest.raises((TypeError, ValueError)) as error:
                star(one)(**kwargs)
            errors.append((error.type, str(error.value)))
        assert errors[0] == errors[1]


def test_a_frozen_value_is_changed_by_nothing_and_is_a_key():
    value = star(frozen)((1.0, 2.0))
    for change in (lambda: setattr(value, "name", "x"), lambda: delattr(value, "name"), lambda: setattr(value, "x", 1)):
        with pytest.raises(FrozenInstanceError):
            change()
    point = Point(1.0)
    assert {point: 1}[Point(1.0)] == 1
    assert replace(point, y=3.0) == Point(1.0, 3.0)
    assert asdict(replace(point, x=Point(2.0))) == {"x": {"x": 2.0, "y": 5.0}, "y": 5.0}
    with pytest.raises(TypeError):
        hash(star(mutable)((1.0, 2.0)))


@pytest.mark.parametrize("duplicate", [lambda one: pickle.loads(pickle.dumps(one)), copy.copy, copy.deepcopy])
def test_values_are_copied_and_sent_to_other_processes(duplicate):
    assert duplicate(Point(1.0, 2.0)) == Point(1.0, 2.0)
    assert duplicate(Space(1.0, 2.0, 3.0)) == Space(1.0, 2.0, 3.0)


def test_values_without_fields_are_equal_and_keys():
    assert Nothing() == Nothing() != Point(1.0)
    assert {Nothing(): 1} == {Nothing(): 1}


def test_a_value_that_extends_another_has_its_fields_first():
    value = Space(1.0, z=4.0)
    assert (value.x, value.y, value.z) == (1.0, 5.0, 4.0)
    assert value != Point(1.0)
    value.z += 1.0
    match value:
        case Space(x, _, z):
            assert (x, z) == (1.0, 5.0)


@frozen
class Point:
    """Of a plane."""

    x: float
    y: float = 5.0


@frozen
class Nothing:
    """No field."""


@mutable
class Area:
    """Of a plane."""

    x: float
    y: float = 5.0


@mutable
class Space(Area):
    """And above it."""

    z: float = 0.0
