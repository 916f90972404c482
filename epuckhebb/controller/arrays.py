"""Arrays of numbers: 64-bit floats throughout, as NumPy and the compiled code have them."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
