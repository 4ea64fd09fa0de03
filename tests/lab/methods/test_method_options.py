"""Every published method tells its options and its paper."""

import numpy as np
import pytest

from kochab.core.errors import UsageError
from kochab.core.frame import Detections, Hint
from kochab.core.progress import run
from kochab.core.registry import checked, options_of
from kochab.identification import IDENTIFIERS

PUBLISHED = [name for name in IDENTIFIERS if name != "patterns"]


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_published_method_names_its_paper_and_options(name) -> None:
    made = IDENTIFIERS.load(name)
    assert made.paper
    options = options_of(made)
    assert len(options) >= 2
    as_typed = {option.name: option.value_text for option in options}
    method = IDENTIFIERS.make(name, **checked(made, as_typed))
    for option in options:
        assert getattr(method, option.name) == option.parse(option.value_text)
        assert getattr(IDENTIFIERS.make(name), option.name) == option.value
        if option.kind in ("number", "integer"):
            assert option.low < option.high


def test_no_such_method_or_value() -> None:
    assert options_of(IDENTIFIERS.load("patterns")) == ()
    with pytest.raises(UsageError, match="choose one of patterns"):
        IDENTIFIERS.load("guess")
    with pytest.raises(UsageError, match="from 3 to 15 stars"):
        checked(IDENTIFIERS.load("triads"), {"stars": "40"})


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("neighbours", {"tolerance_deg": 0.5}),
        ("neighbours", {"distance_step_deg": 0.001}),
        ("neighbours", {"spread": 0.9}),
        ("spherical_triangles", {"limit_deg": 10.0}),
        ("triads", {"mag_limit": 8.0}),
    ],
)
def test_options_whose_table_would_fill_the_memory_are_refused_before(name, options):
    """Each lies within its own range; what they make of the catalogue together does not."""
    method = IDENTIFIERS.make(name, **options)
    rng = np.random.default_rng(1)
    detections = Detections.from_list(rng.uniform(0, 1000, (20, 2)), 1000, 1000)
    with pytest.raises(UsageError, match="fewer stars"):
        run(method.identify(detections, Hint(scale_arcsec_px=(70.0, 72.0))))
