"""Ocean Optics ProcSpec files: a zip of `ps_N.xml`, OOISignatures.xml and OOIVersion.txt.

The XML is a `ProcessedSpectrum` of SpectraSuite, with the wavelengths in nm (`channelWavelengths`) and the
processed values (`processedPixels`) as lists of `double`. It has characters that XML does not allow, which
are left out. No part is unpacked to disk; entities and document types are refused. The layout is that of the
readers of lightr and Veusz.
"""

import io
import re
import zipfile
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from xml.etree.ElementTree import Element

import numpy as np

from pellicle.data.formats.exports import Curve, readable, signal_column
from pellicle.data.tabular.table import Table, array_columns
from pellicle.errors import DataError, install_command

LARGEST_XML = 16 << 20
"""Bytes of unpacked XML that are read; files have about half a megabyte."""
MOST_RATIO = 200
"""Highest ratio of compression; lists of numbers reach about 10."""
_MOST_MEMBERS = 100
_MEMBER = re.compile(r"(?:.*/)?ps_\d+\.xml")
_ANYWHERE = re.compile(rb"ps_\d{1,9}\.xml")
_UNPRINTABLE = re.compile(rb"[^\t\n\r\x20-\x7e]")
_MODE_TAG = re.compile(r"unit|mode|processor|label|type", re.IGNORECASE)
_MODES = {
    "R": re.compile(r"reflect", re.IGNORECASE),
    "T": re.compile(r"transmi", re.IGNORECASE),
    "absorbance": re.compile(r"absorb", re.IGNORECASE),
    "irradiance": re.compile(r"irradian|energy|power", re.IGNORECASE),
}
_NAME = "Ocean Optics ProcSpec"


def layouts(content: bytes, path: str) -> list[Table] | None:
    """Return the processed spectrum of a ProcSpec file, or None for another format.

    Raises DataError where defusedxml is absent, for a damaged file, and for one that is too large to unpack.
    """
    if not content.startswith(b"PK\x03\x04"):
        return None
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [info for info in archive.infolist() if _MEMBER.fullmatch(info.filename)]
            if not members or len(archive.infolist()) > _MOST_MEMBERS:
                return None
            documents = [_unpacked(archive, info, path) for info in members]
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        NotImplementedError,
        RuntimeError,
        OSError,
        ValueError,
    ) as e:
        if isinstance(e, DataError):
            raise
        if not _ANYWHERE.search(content):
            return None
        raise DataError(
            f"{path}: is an {_NAME} file that cannot be unpacked ({_plain(e)}); copy it again"
        ) from None
    curves = [curve for document in documents for curve in _curves(_parsed(document, path), path)]
    return readable(curves, path)


def _unpacked(archive: zipfile.ZipFile, info: zipfile.ZipInfo, path: str) -> bytes:
    """The content of a member. Raises DataError for one that is too large, before it is unpacked."""
    document = b""
    too_large = info.file_size > LARGEST_XML or info.file_size > MOST_RATIO * max(info.compress_size, 1)
    if not too_large:
        with archive.open(info) as member:
            document = member.read(LARGEST_XML + 1)  # the size that the directory states may be wrong
    if too_large or len(document) > LARGEST_XML:
        raise DataError(
            f"{path}: is an {_NAME} file whose {info.filename} unpacks to {info.file_size} bytes, which no "
            "spectrum has; export the spectrum as text"
        )
    return document


def _parsed(document: bytes, path: str) -> Element:
    try:
        from defusedxml.ElementTree import fromstring
    except ImportError:
        raise DataError(
            f"{path}: is an {_NAME} file, which needs the package defusedxml: "
            f"{install_command('formats')}; or export the spectrum as text"
        ) from None
    try:
        return fromstring(_UNPRINTABLE.sub(b"", document), forbid_dtd=True)
    except Exception as error:  # syntax errors, and entities and document types that defusedxml refuses
        raise DataError(
            f"{path}: is an {_NAME} file whose XML cannot be read ({type(error).__name__}: "
            f"{_plain(error)}); export the spectrum as text"
        ) from None


def _plain(error: Exception) -> str:
    """The text of an error in one line."""
    return " ".join(str(error).split())[:200]


def _curves(root: Element, path: str) -> Iterator[Curve]:
    wavelength = _doubles(root, "channelWavelengths", path)
    processed = _doubles(root, "processedPixels", path)
    values = processed if processed.size else _doubles(root, "pixelValues", path)
    if not wavelength.size or wavelength.size != values.size:
        raise DataError(
            f"{path}: is an {_NAME} file of {wavelength.size} wavelengths and {values.size} processed "
            "values; export the spectrum as text"
        )
    quantity = _quantity(root) if processed.size else "counts (the file has no processed spectrum)"
    name = signal_column(quantity) or quantity
    # SpectraSuite shows R and T in percent, but the file does not say so
    name = f"{name} (not stated)" if name in ("R", "T") else name
    layout = array_columns(
        ("wavelength (nm)", name),
        (wavelength, values),
        [f"read as an {_NAME} file"],
        name=name,
        facts=_facts(root),
    )
    yield Curve(layout, "wavelength (nm)", quantity)


def _doubles(root: Element, tag: str, path: str) -> np.ndarray:
    """The numbers of the first element of this name that has some."""
    for element in root.iter(tag):
        texts = [child.text or "" for child in element.iter("double")]
        if texts:
            try:
                return np.array([float(text) for text in texts])
            except ValueError as error:
                raise DataError(
                    f"{path}: {tag} has no number ({error}); export the spectrum as text"
                ) from None
    return np.empty(0)


def _quantity(root: Element) -> str:
    """The quantity of the processed values, "intensity" where the file does not state one alone."""
    words = set()
    for element in root.iter():
        stated = [element.tag, element.get("class", "")]
        if _MODE_TAG.search(element.tag) and len(element) == 0:
            stated.append(element.text or "")
        words |= {mode for mode, pattern in _MODES.items() if any(pattern.search(text) for text in stated)}
    return words.pop() if len(words) == 1 else "intensity"


def _facts(root: Element) -> list[tuple[str, str]]:
    model = (root.findtext(".//spectrometerClass") or "").rpartition(".")[2]
    serial = root.findtext(".//spectrometerSerialNumber") or ""
    facts = [("format", _NAME)]
    if instrument := f"{model} {serial}".strip():
        facts.append(("instrument", instrument))
    milliseconds = root.findtext(".//milliTime") or ""
    if milliseconds.isdigit() and len(milliseconds) < 15:
        date = datetime.fromtimestamp(int(milliseconds) / 1000, UTC)
        facts.append(("date", date.strftime("%Y-%m-%d %H:%M:%S UTC")))
    return facts
