"""Tensor files: named arrays in one little-endian binary file, the container of RGL's `.bsdf` files.

The bytes "tensor_file" and 0, version 1.0 as two bytes, the number of fields as uint32, then for each field
the length of its name (uint16), the name, the number of axes (uint16), a code of its type (uint8), the
position of its data (uint64) and its shape (uint64 for each axis).

Source: Mitsuba 3's documentation and writer (`mitsuba.tensor_io`); rgl.epfl.ch/materials.
"""

import os
import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pellicle.data.tabular.text import open_binary
from pellicle.errors import DataError
from pellicle.files import replacing

MAGIC = b"tensor_file\0"
VERSION = (1, 0)

_TYPES = ("u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f2", "<f4", "<f8")  # codes 1 to 11
_ALIGNMENT = 8
_MOST_FIELDS, _MOST_AXES = 1000, 16


def is_tensor_file(path: str | os.PathLike[str]) -> bool:
    """Return True if a file begins as a tensor file. Raises DataError if it cannot be read."""
    with open_binary(path) as file:
        return file.read(len(MAGIC)) == MAGIC


def read_tensors(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Return the fields of a tensor file by name, mapped from the file and read where they are used.

    Raises DataError for another version and for a damaged file.
    """
    size = Path(path).stat().st_size
    damaged = DataError(f"{path}: is a damaged tensor file; download or export it again")
    fields: dict[str, np.ndarray] = {}
    with open_binary(path) as file:

        def unpack(layout: str) -> tuple[int, ...]:
            length = struct.calcsize("<" + layout)
            piece = file.read(length)
            if len(piece) < length:
                raise damaged
            return struct.unpack("<" + layout, piece)

        file.read(len(MAGIC))
        version = unpack("BB")
        if version != VERSION:
            raise DataError(f"{path}: is a tensor file of version {version[0]}.{version[1]}, 1.0 is expected")
        (count,) = unpack("I")
        if count > _MOST_FIELDS:
            raise damaged
        for _ in range(count):
            (length,) = unpack("H")
            name = file.read(length).decode("utf-8", errors="replace")
            axes, code, offset = unpack("HBQ")
            if axes > _MOST_AXES or not 1 <= code <= len(_TYPES):
                raise damaged
            shape, dtype = unpack("Q" * axes), np.dtype(_TYPES[code - 1])
            items = 1
            for axis in shape:
                items *= axis  # Python's integers do not overflow
            if not items or offset + items * dtype.itemsize > size:
                raise damaged
            fields[name] = np.memmap(path, dtype=dtype, mode="r", offset=offset, shape=shape)
    return fields


def write_tensors(
    path: str | os.PathLike[str], fields: Mapping[str, np.ndarray], *, overwrite: bool = False
) -> None:
    """Write named arrays, of any shape, as a tensor file.

    Raises UsageError where `path` exists without `overwrite`, or cannot be written; ValueError for an array
    of a type that the format does not have.
    """
    arrays = {name: np.ascontiguousarray(array) for name, array in fields.items()}
    codes = {np.dtype(kind): code for code, kind in enumerate(_TYPES, 1)}
    size = len(MAGIC) + 2 + 4 + sum(2 + len(name.encode()) + 11 + 8 * a.ndim for name, a in arrays.items())
    head, data = [MAGIC, struct.pack("<BBI", *VERSION, len(arrays))], []
    for name, array in arrays.items():
        code, label = codes.get(array.dtype), name.encode()
        if code is None:
            raise ValueError(f"`{name}`: tensor files have no numbers of type {array.dtype}")
        padding = -size % _ALIGNMENT
        head += [struct.pack("<H", len(label)), label, struct.pack("<HBQ", array.ndim, code, size + padding)]
        head.append(struct.pack(f"<{array.ndim}Q", *array.shape))
        data += [b"\0" * padding, array.tobytes()]
        size += padding + array.nbytes
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(b"".join(head + data))
