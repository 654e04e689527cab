"""Types that appear in signatures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Union

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.uint32]
Path = Union[str, "PathLike[str]"]

# What a key of a scene takes: text with its unit, numbers in SI units, truths, lists and tables of these.
Setting = Union[
    str, float, bool, "np.generic", NDArray[Any], Sequence["Setting"], Mapping[str, "Setting"]
]
