"""Options are told once and hold everywhere."""

from dataclasses import dataclass

import pytest

from kochab.core.errors import UsageError
from kochab.core.registry import checked, choice, integer, number, options_of, pair, switch


@dataclass(frozen=True, slots=True)
class Method:
    stars: int = integer(12, "stars", 3, 15, "detections used")
    margin_px: float = number(2.5, "px", 0.1, 20.0, "error allowed")
    limit: float | None = number(None, "mag", 3.0, 8.0, "faintest", none="all")
    dec_deg: tuple[float, float] = pair((-90.0, 90.0), "deg", -90, 90, "declinations")
    planar: bool = switch(False, "flat")
    arithmetic: str = choice("float", ("float", "fixed"), "numbers")
    hidden: int = 3


def test_defaults_are_the_fields_own() -> None:
    made = Method()
    told = options_of(Method)
    assert [option.name for option in told] == ["stars", "margin_px", "limit", "dec_deg", "planar", "arithmetic"]
    for option in told:
        assert option.check(getattr(made, option.name)) == option.value
        assert option.parse(option.value_text) == option.value
        assert option.text
    assert options_of(int) == ()


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("stars", "7", 7),
        ("margin_px", "3", 3.0),
        ("limit", "none", None),
        ("limit", "6", 6.0),
        ("dec_deg", "-10,30.5", (-10.0, 30.5)),
        ("planar", "on", True),
        ("planar", "No", False),
        ("arithmetic", "fixed", "fixed"),
    ],
)
def test_typed_values(name, text, value) -> None:
    assert checked(Method, {name: text}) == {name: value}
    assert checked(Method, {name: value}) == {name: value}


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("stars", "2", "whole number from 3 to 15 stars"),
        ("stars", "7.5", "whole"),
        ("stars", 7.0, "whole"),
        ("stars", True, "whole"),
        ("margin_px", "nan", "px"),
        ("margin_px", "none", "0.1 to 20"),
        ("margin_px", "1,2", "number"),
        ("limit", "9", "or none"),
        ("dec_deg", "4", "two numbers"),
        ("dec_deg", "-91,4", "-90"),
        ("planar", "perhaps", "on or off"),
        ("arithmetic", "decimal", "float or fixed"),
        ("hidden", "4", "no option hidden"),
        ("speed", "4", "stars, margin_px"),
    ],
)
def test_what_is_not_allowed_is_said_in_one_sentence(name, value, says) -> None:
    with pytest.raises(UsageError, match=says) as error:
        checked(Method, {name: value})
    assert str(error.value).endswith(".")
