"""What a target is: good inputs, how they are changed, and what must hold of any of them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from kochab.core.errors import KochabError
from tests.fuzz.mutate import Mutate, raw


class WrongAnswerError(AssertionError):
    """Something was made of an input that is not in it."""


@dataclass(frozen=True, slots=True)
class Target:
    """``seeds`` writes into a folder what it needs; ``check`` raises for anything but a sentence of the package.

    ``count`` is its part of a run; ``quick`` how many of them the ordinary tests try. What is
    ``sandboxed`` is read in a process of its own: there a decoder may crash or hang.
    """

    name: str
    seeds: Callable[[Path], list[bytes]]
    check: Callable[[bytes, Path], None]
    mutate: Mutate = raw
    count: int = 1000
    quick: int = 5
    sandboxed: str = ""


@contextmanager
def told(*kinds: type[KochabError]) -> Iterator[None]:
    """Errors of these kinds are an answer when they are one sentence."""
    try:
        yield
    except KochabError as error:
        if kinds and not isinstance(error, kinds):
            raise
        text = str(error)
        if not text or "\n" in text or len(text) > 1500 or text[-1] not in ".?!)…”'":
            raise AssertionError(f"no sentence: {text[:300]!r}") from error


def require(holds: object, what: str) -> None:
    """Raise `WrongAnswerError` unless it holds."""
    if not holds:
        raise WrongAnswerError(what)
