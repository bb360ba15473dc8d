"""Textures of an object: images of a thickness in nm or of a roughness, and fitted maps without holes."""

import os
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from pellicle.errors import DataError, UsageError
from pellicle.files import replacing
from pellicle.fitting.batch.data import BY_NEIGHBOURS, CODES
from pellicle.mapping.map_result import CONVERGED, Map
from pellicle.mapping.photograph import ThicknessMap
from pellicle.mapping.store import STATUS

_LEAST = 3.0
"""Largest thickness (nm) of a map in nm at least: one of 3 µm is beyond all interference colours."""


def read_image(path: str | os.PathLike[str], argument: str, largest: bool = False) -> np.ndarray:
    """Read an image of numbers, (rows, columns): an array in `.npy`, or a grey image of 8 or 16 bits.

    `argument` is what the image is for. With `largest` the white of a grey image is 1.

    **Raises:** DataError for a file that cannot be read.
    """
    what = f"map of {argument.removesuffix('_map')}"
    try:
        if Path(path).suffix.lower() == ".npy":
            values = np.load(path, allow_pickle=False)
        else:
            from PIL import Image  # a requirement of Matplotlib

            with Image.open(path) as image:
                grey = image.convert("L") if image.mode == "1" else image  # else its white is 1
                # a pixel of a palette (P) is the number of its colour
                if len(grey.getbands()) > 1 or grey.mode == "P":
                    raise ValueError("it has a palette or several channels")
                # Pillow opens some grey images of 16 bits as integers of 32
                white = {"L": 255, "F": 1}.get(grey.mode, 65535)
                values = np.asarray(grey) / (white if largest else 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise DataError(
            f"{path}: cannot be read as a {what} ({reason}); give an array in .npy or a grey PNG"
        ) from None
    return values


class MappedFilm(NamedTuple):
    """Film of a map: thickness (nm) at every texel, medians of fitted parameters by name, and sentences.

    `others` are the parameters beside the thickness at every texel, and `medians` sentences on their medians.
    """

    thickness: Float[np.ndarray, "rows columns"]
    values: dict[str, float]
    notes: tuple[str, ...]
    others: dict[str, Float[np.ndarray, "rows columns"]]
    medians: dict[str, str]


def mapped_film(given: Any, layer: str | None = None) -> MappedFilm:
    """Return the film of a map, for a texture.

    **Arguments:** `given`, thicknesses in nm, (rows, columns), as an array or as the path of an image, or a
    fitted `Map` or `ThicknessMap`; `layer`, whose thickness it is, by default the first free one. Pixels of
    a `Map` without one thickness, and those that are NaN, take the thickness of the nearest that has one.

    **Raises:** UsageError for a map that is no image, of another layer, or without a thickness anywhere, and
    for wrong values; DataError as `read_image` does.
    """
    if isinstance(given, Map):
        return _fitted(given, layer)
    if isinstance(given, ThicknessMap):
        if given.position is not None:
            raise UsageError("`thickness_map` is a strip, and a texture has rows and columns: map a region")
        given = given.found.thickness[..., 0]
    array = _array(given, "thickness_map", _not_nm)
    (array,), notes = _filled([array], np.isfinite(array))
    return MappedFilm(array, {}, notes, {}, {})


def _not_nm(array: np.ndarray) -> str:
    """A sentence on values that are no thicknesses in nm, empty where all may be."""
    if np.any(np.isinf(array)) or np.any(array < 0):
        return "must have finite thicknesses in nm, none below 0"
    largest = np.max(array, where=np.isfinite(array), initial=0.0)
    if largest < _LEAST and np.any(np.isfinite(array)):
        return f"is {largest:.3g} nm thick at most: give thicknesses in nm, not in µm"
    return ""


def roughness_image(given: Any) -> np.ndarray:
    """GGX α from 0 to 1, (rows, columns), of an array or of the path of an image; raises as `mapped_film`."""

    def wrong(array: np.ndarray) -> str:
        inside = np.all((array >= 0) & (array <= 1))
        return "" if inside else "must have roughnesses α (GGX) from 0 to 1"

    return _array(given, "roughness_map", wrong, largest=True)


def _array(
    given: Any, argument: str, wrong: Callable[[np.ndarray], str], *, largest: bool = False
) -> np.ndarray:
    """An array (rows, columns), or that of an image, of which `wrong` finds nothing to say."""
    path = given if isinstance(given, str | os.PathLike) else None
    content = given if path is None else read_image(path, argument, largest)
    try:
        array = np.asarray(content, float)
    except ValueError:
        raise UsageError(f"`{argument}` must have numbers") from None
    if array.ndim != 2 or array.size == 0:
        sentence = f"must have the shape (rows, columns), not {array.shape}"
    else:
        sentence = wrong(array)
    if sentence and path is not None:
        raise DataError(f"{path}: {sentence}")
    if sentence:
        raise UsageError(f"`{argument}` {sentence}")
    return array


def share_of_range(values: Float[np.ndarray, "rows columns *channels"]) -> np.ndarray:
    """An image from 0 at its least to 1 at its largest value, each channel by itself."""
    low, span = values.min(axis=(0, 1)), np.ptp(values, axis=(0, 1))
    return (values - low) / np.where(span > 0, span, 1.0)


def png(share: Float[np.ndarray, "rows columns *channels"]) -> bytes:
    """Encode values from 0 to 1 as a PNG: grey of 16 bits, or of 8 bits where it has three channels."""
    from PIL import Image  # a requirement of Matplotlib

    white, kind = (65535, np.uint16) if share.ndim == 2 else (255, np.uint8)
    Image.fromarray(np.round(white * share).astype(kind)).save(file := BytesIO(), format="PNG")
    return file.getvalue()


def write_image(path: Path, share: Float[np.ndarray, "rows columns *channels"]) -> Path:
    """Write values from 0 to 1 as a PNG."""
    with replacing(path) as temporary:
        temporary.write_bytes(png(share))
    return path


def _fitted(made: Map, layer: str | None) -> MappedFilm:
    """The film of the map of a cube."""
    if len(made.dims) != 2:
        raise UsageError(
            f"{made.path}: is a map along {', '.join(made.dims)}, and a texture has rows and columns: give"
            " the thickness of one image as `thickness_map`"
        )
    names = [name for name in made.parameters if name.rpartition(".")[2] == "thickness"]
    if layer is not None and len(names) > 1:
        names = [name for name in names if name == f"{layer}.thickness"]
    if not names:
        raise UsageError(f"{made.path}: has no fitted thickness" + (f" of {layer}" if layer else ""))
    known = np.isin(made.dataset[STATUS].values, [CODES[CONVERGED], CODES[BY_NEIGHBOURS]])
    order = [names[0], *(name for name in made.parameters if name != names[0])]
    images = {name: made[name].values for name in order}
    (thickness, *others), notes = _filled([*images.values()], known)
    values = {name: float(np.median(image[known])) for name, image in images.items()}
    medians = {}
    for name in order[1:]:
        low, high = np.quantile(images[name][known], [0.05, 0.95])
        medians[name] = (
            f"{name} is {values[name]:.4g}, the median of the map (of 90 %: {low:.4g} to {high:.4g})"
        )
    return MappedFilm(thickness, values, notes, dict(zip(order[1:], others, strict=True)), medians)


def _filled(
    images: list[np.ndarray], known: Bool[np.ndarray, "rows columns"]
) -> tuple[list[np.ndarray], tuple[str, ...]]:
    """Images whose unknown pixels take the values of the nearest known one, and a sentence on it."""
    from scipy.ndimage import distance_transform_edt  # slow to import

    if not known.any():
        raise UsageError("`thickness_map` has no pixel with one thickness; export its recipe")
    if known.all():
        return images, ()
    nearest: Any = distance_transform_edt(~known, return_distances=False, return_indices=True)
    share = f"{100 * (1 - known.mean()):.2g} % of the map has no thickness of its own"
    return [image[tuple(nearest)] for image in images], (f"{share}, and takes the nearest",)
