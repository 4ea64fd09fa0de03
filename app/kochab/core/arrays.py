"""The arrays all rooms speak of, named once.

Radians, unit vectors ``(N, 3)`` and pixels ``(N, 2)`` as x, y are ``Floats``; row numbers are ``Ints``.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]
Ints32 = NDArray[np.int32]
Floats32 = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Array = NDArray[Any]  # of a type that the file or the device decides
