"""Texts and numbers in a person's language: English in the code, another where the window was told how to translate."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from numbers import Number

Translate = Callable[[str, str, int], str | None]
"""From an English text, its note and the number it counts (-1: none) to the same in a language that has it."""
_translate: Translate | None = None
# Also tells whether a language is on: empty means numbers are written as format() writes them.
_points: dict[int, str] = {}
# A context variable: one thread may export in English while another draws the window.
_english = ContextVar("english", default=False)


def speak(translate: Translate | None = None, decimal_point: str = ".", group_separator: str = ",") -> None:
    """Show texts and numbers in another language from now on; without arguments in English again."""
    global _translate, _points
    _translate = translate
    _points = {ord("."): decimal_point, ord(","): group_separator} if translate else {}


@contextmanager
def in_english() -> Iterator[None]:
    """Within it texts and numbers are English all the same: for what is copied, exported or read by machines."""
    before = _english.set(True)
    try:
        yield
    finally:
        _english.reset(before)


def tr(text: str, note: str = "", /, **values: object) -> str:
    """``text`` in the person's language, with ``values`` in its named places, as ``str.format`` puts them.

    ``note`` tells two English texts apart that other languages say differently.
    """
    return _filled(_translated(text, note, -1), text, values)


def tr_n(one: str, many: str, n: int, /, **values: object) -> str:
    """The same for a text that counts ``n`` things, which stands in it as ``{n}``.

    Parameters
    ----------
    one : str
        The English text for one thing.
    many : str
        The English text for any other number.
    n : int
        How many.
    **values : object
        What comes into the other named places, as :func:`tr` has it.
    """
    return _filled(_translated(one, many, n), one if n == 1 else many, {"n": n, **values})


def tr_noop(text: str, note: str = "", /) -> str:
    """``text`` as it is, known to translators: for tables, whose texts go through :func:`tr` where they are shown."""
    return text


def number(value: float, spec: str = "") -> str:
    """``value`` as ``format`` writes it, with the decimal point and the thousands of the person's language."""
    return format(value, spec).translate({} if _english.get() else _points)


class _Shown:
    """A number that formats itself by :func:`number`."""

    def __init__(self, value: float) -> None:
        self.value = value

    def __format__(self, spec: str) -> str:
        return number(self.value, spec)


def _translated(text: str, note: str, n: int) -> str | None:
    return None if _translate is None or not text or _english.get() else _translate(text, note, n)


def _filled(translated: str | None, text: str, values: dict[str, object]) -> str:
    if _points:
        values = {name: _Shown(v) if isinstance(v, Number) else v for name, v in values.items()}  # type: ignore[arg-type]
    if not values:
        return translated or text
    try:
        return (translated or text).format(**values)
    except (LookupError, ValueError):  # a translation with places of its own: its error must not hide this sentence
        return text.format(**values)
