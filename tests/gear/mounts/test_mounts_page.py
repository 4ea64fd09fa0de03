"""The page of mounts says what the drivers say."""

from kochab.gear.mounts import DRIVERS
from tests.gear.mounts.mounts_page import EXCHANGES, PAGE, page
from tests.gear.mounts.test_real_transcripts import ALL
from tests.patterns import REPOSITORY


def test_the_page_is_that_of_the_drivers_tables() -> None:
    assert PAGE.read_text("utf-8") == page(), "run `python -m tests.gear.mounts.mounts_page`"


def test_every_driver_has_its_row_and_the_readme_leads_there() -> None:
    text = PAGE.read_text("utf-8")
    assert all(f"| `{name}` |" in text for name in DRIVERS)
    assert "app/MOUNTS.md" in (REPOSITORY / "README.md").read_text("utf-8")
    assert "No real telescope has met Kochab yet" in text


def test_the_families_of_the_real_exchanges_are_the_collection_s() -> None:
    numbers = {f"L{n:02d}" for first, last in EXCHANGES.values() for n in range(first, last + 1)} | {"L2A", "L2B"}
    assert numbers <= ALL | {"L20"}
