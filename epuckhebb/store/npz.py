"""Reads the arrays of `.npz` files with limits on size and shape, so that a damaged file ends in one message."""

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.runtime import ConfigError

MOST = 64 * 2**20  # bytes of an array whose size is not known otherwise; the weights of the largest network take 0.8 MB
_KINDS = {"iu": "whole numbers", "f": "numbers", "fiu": "numbers", "U": "text", "fiuU": "numbers or text"}  # of dtypes
Shape = Sequence[int | None]  # None where any length will do


def compressed(arrays: dict[str, Any]) -> bytes:
    """The content of an `.npz` file that holds these arrays."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


class Arrays:
    """The arrays of a `.npz`, or the one of a `.npy`, which is that of the genome; each is checked as it is read.

    A few bytes may unpack to more than there is memory for. So at most `MOST` bytes of an array are read, or as many
    as the shape that is wanted takes, or as the file itself has.
    """

    def __init__(self, content: bytes) -> None:
        """Look into a file with this content."""
        self._most = max(MOST, len(content))
        found = np.load(io.BytesIO(content), allow_pickle=False)
        if isinstance(found, np.ndarray):
            self._arrays: Mapping[str, NDArray[Any]] = {"genome": found}
            self._bytes = {"genome": found.nbytes}
        else:
            self._arrays = found
            self._bytes = {info.filename.removesuffix(".npy"): info.file_size for info in found.zip.infolist()}
        self.names = list(self._bytes)

    def __contains__(self, name: str) -> bool:
        """Whether there is an array of this name."""
        return name in self.names

    def take(self, name: str, kinds: str, shape: Shape | None = None) -> NDArray[Any]:
        """Read an array; a ValueError says if it is not there, or something else.

        kinds: the letters of the dtypes that it may have, a key of `_KINDS`. shape: what it must be; None for any.
        """
        if name not in self:
            raise ValueError(f"it has no array {name}")
        wanted = math.prod(n or 0 for n in shape or (0,)) * np.dtype(float).itemsize
        if self._bytes[name] > max(self._most, wanted + MOST):
            raise ValueError(f"{name} takes {self._bytes[name]} bytes; at most {self._most} are read")
        found = self._arrays[name]
        sizes = found.shape if shape is None else shape
        fits = len(found.shape) == len(sizes) and all(n in (None, m) for n, m in zip(sizes, found.shape, strict=True))
        if found.dtype.kind not in kinds or not fits:
            wanted_shape = ", ".join("any" if n is None else str(n) for n in sizes)
            allowed = _KINDS[kinds] if shape is None else f"{_KINDS[kinds]} of shape ({wanted_shape})"
            raise ValueError(f"{name} must be {allowed}, it is {found.dtype} of shape {found.shape}")
        return found.astype(found.dtype.newbyteorder("="))

    def text(self, name: str) -> str:
        """A text."""
        return str(self.take(name, "U", ()))

    def layers(self) -> tuple[int, ...] | None:
        """The layers of the network that the file is for, if it says so."""
        return tuple(self.take("layers", "iu", (None,)).tolist()) if "layers" in self else None


@contextmanager
def one_error(what: str) -> Iterator[None]:
    """Tell of whatever goes wrong while a file is read as one `ConfigError` that begins so."""
    try:
        yield
    except ConfigError:
        raise
    except Exception as error:  # what damaged bytes may raise has no end
        raise ConfigError(f"{what}: {error or type(error).__name__}") from error
