"""Masks of pixels: which are used, from an image, a NumPy file, an array or a variable of the cube."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.cubes.raw_cube import RawCube
from pellicle.data.photographs import image_format
from pellicle.errors import DataError, UsageError, install_command


def read_mask(mask: str | os.PathLike[str] | np.ndarray, raw: RawCube, sizes: tuple[int, ...]) -> np.ndarray:
    """Return True for the pixels to use (*pixels), where the mask is not zero and not NaN.

    A mask of the last axes, as y and x of a series in time, applies to all of the first. Raises DataError for
    another size, UsageError for what is no mask.
    """
    if isinstance(mask, np.ndarray):
        values, name = mask, "the mask"
    else:
        name = os.fspath(mask)
        if name in raw.others:
            stored = raw.others[name]
            values = np.transpose(
                stored.read({}), [stored.axes.index(a) for a in raw.dims if a in stored.axes]
            )
        else:
            values = _file(Path(name), raw)
    used = values != 0
    if values.dtype.kind == "f":
        used &= ~np.isnan(values)
    if used.shape != sizes[-used.ndim :]:
        raise DataError(
            f"{name}: has {' x '.join(map(str, used.shape))} pixels and {raw.path} has "
            f"{' x '.join(map(str, sizes))}: the mask must have the same"
        )
    if not used.any():
        raise DataError(f"{name}: masks every pixel: what is not zero is used")
    return np.broadcast_to(used, sizes)


def _file(path: Path, raw: RawCube) -> np.ndarray:
    if not path.is_file():
        known = f" or one of its variables {', '.join(map(repr, raw.others))}" if raw.others else ""
        raise UsageError(f"`mask` {str(path)!r} is no file{known}: name a PNG, a TIFF or a .npy file")
    if path.suffix.lower() == ".npy":
        values = np.load(path, mmap_mode="r")
        return np.asarray(values)
    kind = image_format(path)
    if kind is None:
        raise UsageError(f"`mask` {str(path)!r} is no PNG, TIFF or .npy file: save it as one of these")
    try:
        values = _image(path, kind)
    except ImportError as error:
        raise UsageError(f"{path}: images need {error.name}: {install_command('images')}") from None
    except Exception as error:  # decoders raise errors of every kind on damaged files
        raise DataError(f"{path}: the {kind} cannot be read ({error}); save it again") from None
    return values if values.ndim == 2 else np.any(values[..., :3] != 0, axis=-1)


def _image(path: Path, kind: str) -> Any:
    if kind == "TIFF":
        import tifffile

        return tifffile.imread(path)
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB") if image.mode == "P" else image)
