"""Every published method tells its options and its paper."""

import pytest

from app.core.errors import UsageError
from app.identify import IDENTIFIERS, make_identifier
from app.identify.options import checked_options, method_class, method_options, paper_of

PUBLISHED = [name for name in IDENTIFIERS if name != "patterns"]


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_published_method_names_its_paper_and_options(name) -> None:
    assert paper_of(name)
    options = method_options(name)
    assert len(options) >= 2
    as_typed = {option.name: option.value_text for option in options}
    method = make_identifier(name, **checked_options(name, as_typed))
    for option in options:
        assert getattr(method, option.name) == option.parse(option.value_text)
        assert getattr(make_identifier(name), option.name) == option.value
        if option.kind in ("number", "integer"):
            assert option.low < option.high


def test_no_such_method_or_value() -> None:
    assert method_options("patterns") == ()
    with pytest.raises(UsageError, match="choose one of patterns"):
        method_class("guess")
    with pytest.raises(UsageError, match="from 3 to 15 stars"):
        checked_options("triads", {"stars": "40"})
