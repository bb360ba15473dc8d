"""Guarded reading of HDF5 files: groups, numbers and texts, without leaving the file.

External links, external storage and virtual datasets would open other files; they are refused, as are
datasets and chunks too large for a spectrum, before anything is allocated. Soft links are followed part by
part.
"""

from collections.abc import Iterator
from math import prod
from typing import Any

import numpy as np

from pellicle.errors import DataError

SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_NUMBERS = 5_000_000
"""Largest number of values of a dataset that is read, 40 MB."""
_MOST_CHUNK = 64 << 20  # bytes that HDF5 allocates for a chunk, whatever the dataset holds
_MOST_TEXT = 10_000  # bytes
_MOST_GROUPS = 1000
_MOST_LINKS = 20  # soft links that point to soft links
_MOST_DEPTH = 20


def groups(file: Any) -> Iterator[tuple[str, Any]]:
    """Yield the root and every group below it once, with its name; links to elsewhere are not followed.

    Raises DataError for more than 1000 groups.
    """
    import h5py

    pending: list[tuple[str, Any]] = [("/", file)]
    seen: set[Any] = set()
    while pending:
        name, group = pending.pop(0)
        if len(seen) > _MOST_GROUPS:
            raise DataError(f"has more than {_MOST_GROUPS} groups; export one spectrum as CSV")
        if group in seen or name.count("/") > _MOST_DEPTH:  # equal groups are one under two names
            continue
        seen.add(group)
        yield name, group
        for child in group:
            if isinstance(group.get(child, getlink=True), h5py.HardLink):
                member = group[child]
                if isinstance(member, h5py.Group):
                    pending.append((f"{name.rstrip('/')}/{child}", member))


def member(group: Any, name: str, links: int = 0) -> Any:
    """Return a member by its name or path, None where it is missing.

    Raises DataError for a link to another file, and for links in a circle.
    """
    import h5py

    here: Any = group.file if name.startswith("/") else group
    for part in name.strip("/").split("/"):
        link = here.get(part, getlink=True) if isinstance(here, h5py.Group) else None
        if link is None:
            return None
        if isinstance(link, h5py.ExternalLink):
            raise DataError(f"{name} is a link to another file, {link.filename!r}; export the data into one")
        if isinstance(link, h5py.SoftLink):
            if links > _MOST_LINKS:
                raise DataError(f"{name} is a link to itself; export it again")
            here = member(here, link.path, links + 1)
        else:
            here = here[part]
    return here


def numbers(dataset: Any, name: str) -> np.ndarray | None:
    """Return the values of a dataset of numbers, None for anything else.

    Raises DataError for one that is stored in another file, or too large.
    """
    import h5py

    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiu" or dataset.shape is None:
        return None
    if dataset.is_virtual or dataset.external:
        raise DataError(f"{name} is stored in another dataset or file; export the data into one")
    chunk = prod(dataset.chunks or (1,)) * dataset.dtype.itemsize
    if dataset.size is None or dataset.size > MOST_NUMBERS or chunk > _MOST_CHUNK:
        raise DataError(f"{name} has {dataset.size} values, more than a spectrum; export one spectrum as CSV")
    return np.asarray(dataset[()], dtype=np.float64)


def text(dataset: Any) -> str:
    """Return the text of a dataset of one short string, else an empty text."""
    import h5py

    if not isinstance(dataset, h5py.Dataset) or dataset.size != 1 or dataset.is_virtual or dataset.external:
        return ""
    if h5py.check_string_dtype(dataset.dtype) is None or dataset.dtype.itemsize > _MOST_TEXT:
        return ""
    return _plain(dataset[()])


def attribute(thing: Any, name: str) -> str:
    """Return an attribute that is a short text, else an empty text."""
    if name not in thing.attrs or thing.attrs.get_id(name).get_storage_size() > _MOST_TEXT:
        return ""
    return _plain(thing.attrs[name])


def _plain(value: Any) -> str:
    if isinstance(value, np.ndarray):
        value = value.reshape(-1)[0] if value.size == 1 else ""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return value[:_MOST_TEXT].strip() if isinstance(value, str) else ""
