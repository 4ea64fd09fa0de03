"""Values of a camera server that are not what they should be."""

from collections.abc import Iterator
from contextlib import contextmanager

from app.core.errors import NoAnswerError


@contextmanager
def making_sense() -> Iterator[None]:
    """Turn what comes of values of the wrong kind into one sentence: None, "x", 1e999, {}."""
    try:
        yield
    except (ValueError, TypeError, AttributeError, ArithmeticError, LookupError) as error:
        raise NoAnswerError("The camera's server tells values that make no sense.") from error
