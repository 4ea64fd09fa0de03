"""Texts and numbers in a person's language, and in English where a machine reads them."""

from contextlib import suppress

import pytest

from kochab.text.translation import in_english, number, speak, tr, tr_n

GERMAN = {"Saved {name}": "{name} gespeichert", "{n} star": "{n} Stern", "{n} stars": "{n} Sterne"}


@pytest.fixture(autouse=True)
def _german():
    def translate(text, note, n):
        return GERMAN.get(f"{text}s" if n > 1 else text, text)

    speak(translate, ",", ".")
    yield
    speak()


def test_what_is_copied_is_english_and_what_follows_is_not():
    german = (tr("Saved {name}", name="M 42"), tr_n("{n} star", "{n} stars", 2), number(1234.5, ",.1f"))
    assert german == ("M 42 gespeichert", "2 Sterne", "1.234,5")
    with in_english():
        with in_english():
            assert number(0.5, ".1f") == "0.5"
        assert tr("Saved {name}", name="M 42") == "Saved M 42"
        assert tr_n("{n} star", "{n} stars", 2) == "2 stars"
        assert number(1234.5, ",.1f") == "1,234.5"
    assert tr("Saved {name}", name="M 42") == "M 42 gespeichert"
    with suppress(ZeroDivisionError), in_english():
        _ = 1 / 0
    assert number(0.5, ".1f") == "0,5"


def test_without_a_language_everything_is_english_again():
    speak()
    assert (tr("Saved {name}", name="M 42"), number(1234.5, ",.1f")) == ("Saved M 42", "1,234.5")
