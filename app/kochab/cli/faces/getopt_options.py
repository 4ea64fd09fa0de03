"""Long and short options as C programs read them, for the faces of those that use getopt."""

from collections.abc import Iterable, Mapping, Sequence
from getopt import GetoptError, gnu_getopt

from kochab.core.errors import UsageError


def getopt_options(
    words: Sequence[str], flags: Iterable[str], valued: Iterable[str], short: Mapping[str, str]
) -> tuple[dict[str, str], list[str]]:
    """The options among words, by their long names, and the words that belong to none.

    Of an option given twice the last value holds; a flag's is "". Raises UsageError for an option that is not among
    them, or lacks its value.

    Parameters
    ----------
    words : sequence of str
        The arguments.
    flags, valued : iterable of str
        Long names of the options without and with a value.
    short : mapping of str to str
        The long name of each letter.
    """
    flags = set(flags)
    letters = "".join(letter + ("" if name in flags else ":") for letter, name in short.items())
    try:
        found, left = gnu_getopt([*words], letters, [*flags, *(f"{name}=" for name in valued)])
    except GetoptError as error:
        raise UsageError(f"{error.msg[:1].upper()}{error.msg[1:]}.") from None
    return {short.get(name.lstrip("-"), name.lstrip("-")): value for name, value in found}, left
