"""The arrays all rooms speak of, named once, and tables of arrays that share their rows.

Radians, unit vectors ``(N, 3)`` and pixels ``(N, 2)`` as x, y are ``Floats``; row numbers are ``Ints``.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from kochab.core.values import frozen

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]
Ints32 = NDArray[np.int32]
Floats32 = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Array = NDArray[Any]  # of a type that the file or the device decides


@frozen(eq=False)
class Table:
    """A dataclass of arrays that share the length N, one row a star; other fields belong to all rows."""

    def _arrays(self) -> Iterator[tuple[str, Array]]:
        values = ((name, getattr(self, name)) for name in self.__dataclass_fields__)
        # What is no array belongs to all rows and is left as it is.
        return ((name, value) for name, value in values if isinstance(value, np.ndarray))

    def __len__(self) -> int:
        return len(next(self._arrays())[1])

    def take(self, index: Ints | Indices | Bools | slice) -> Self:
        """The rows that ``index`` selects, in its order."""
        values = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return type(self)(**{k: v[index] if isinstance(v, np.ndarray) else v for k, v in values.items()})

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The rows of all parts, one part after another; what belongs to all rows is the first part's."""
        columns = [dict(part._arrays()) for part in parts]
        return replace(parts[0], **{name: np.concatenate([c[name] for c in columns]) for name in columns[0]})
