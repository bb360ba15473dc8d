"""Binary files of spectrometers: GRAMS SPC, Bruker OPUS, PerkinElmer, JASCO, Ocean Optics ProcSpec.

All but the last are recognised by their first bytes and decoded by the package openreadout (extra `formats`),
from memory. It gives each trace with the quantity and the unit of both axes; what it does not name is not
guessed.
"""

import io
import re
import struct
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from pellicle.data.formats.exports import Curve, axis_column, first_stated, readable, signal_column
from pellicle.data.tabular.columns import recognise
from pellicle.data.tabular.table import Table, array_columns
from pellicle.errors import DataError, decoding, needs

_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_JASCO_STREAM = "DataInfo".encode("utf-16-le")
_SPC_VERSIONS = (0x4B, 0x4C, 0x4D)
_SPC_HEADERS = {0x4B: "<4xIdd", 0x4C: ">4xIdd", 0x4D: "<4xfff"}
_SPC_OLD = 0x4D
_SPC_SHORTEST = {0x4B: 512, 0x4C: 512, 0x4D: 256}  # bytes of the header
_SPC_SMALLEST, _SPC_LARGEST = 1e-6, 1e9
"""Ends of a plausible axis; text read as numbers lies outside."""
_FORMATS = {
    "spc": "GRAMS SPC",
    "0": "Bruker OPUS",
    "sp": "PerkinElmer .sp",
    "jws": "JASCO .jws",
}
_FACTS = {
    "instrument": ("instrument", "source_instrument", "instrument_model"),
    "date": ("acquired_at", "recorded_at", "measured_at"),
    "sample": ("sample_name", "title"),
}
_JASCO_INVALID = -1.2e-38
"""JASCO writes about -1.18e-38 for a point that was not measured."""
_MOST_SPECTRA = 1000

_SPECTRAL = ("wavelength", "wavenumber", "energy")
_OF_QUANTITY = {"transmittance": "T", "reflectance": "R", "absorbance": "absorbance", "log_1_r": "log(1/R)"}

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
_PROCSPEC = "Ocean Optics ProcSpec"


def by_openreadout(content: bytes) -> list[Table] | None:
    """Return the spectra of such a file, or None for another format.

    Raises DataError where openreadout is absent or cannot read the file, and for other quantities.
    """
    kind = _kind(content)
    if kind is None:
        return None
    name = _FORMATS[kind]
    absent = f"is a {name} file, which needs the package", "; or export the spectrum as CSV"
    damaged = decoding(f"is a {name} file that cannot be read", "export it as CSV")
    with needs("formats", *absent, DataError), damaged:
        import openreadout

        with openreadout.File(content, name=f"file.{kind}") as file:
            findings = file.check()["findings"]
            if damage := next((x["message"] for x in findings if x["severity"] == "error"), ""):
                raise DataError(  # openreadout reads what is left
                    f"is a damaged {name} file ({_plain(damage)}); copy or export it again"
                )
            curves = list(_curves(file, name, len(content)))
    if not curves:
        raise DataError(f"is a {name} file without a spectrum; export it as CSV")
    return readable(curves)


def _kind(content: bytes) -> str | None:
    """The usual suffix of the format whose first bytes these are, which openreadout takes as a hint."""
    if content.startswith(b"\n\n\xfe\xfe"):
        return "0"
    if content.startswith(b"PEPE"):
        return "sp"
    if content.startswith(b"L~S ") or (content.startswith(_OLE) and _JASCO_STREAM in content):
        return "jws"
    # of SPC the version is one byte, which text may have too
    version = content[1] if len(content) > 1 else 0
    if version not in _SPC_VERSIONS or len(content) < _SPC_SHORTEST[version] or b"\0" not in content[:32]:
        return None
    points, first, last = struct.unpack_from(_SPC_HEADERS[version], content)
    axis_code, signal_code = content[16:18] if version == _SPC_OLD else content[28:30]
    ends = (abs(first), abs(last))
    plausible = first != last and all(x == 0 or _SPC_SMALLEST < x < _SPC_LARGEST for x in ends)
    plausible = plausible and points >= 1 and axis_code <= 31 and (signal_code <= 32 or signal_code >= 128)
    return "spc" if plausible else None


def _curves(file: Any, name: str, size: int) -> Iterator[Curve]:
    """The sweeps of each trace of an open file."""
    for index, trace in enumerate(file.traces):
        channels, sweeps, points = trace["channels"], trace["sweep_count"], trace["sample_count"]
        if points * sweeps > size or sweeps > _MOST_SPECTRA:  # no value takes less than a byte
            raise DataError(
                f"is a {name} file of {sweeps} spectra of {points} points, more than its {size} "
                "bytes hold or pellicle reads; export the spectrum as CSV"
            )
        extra = trace["extra"]
        axis = _axis(extra)
        for sweep in range(sweeps):
            values = np.asarray(file.read_trace(index, sweep))
            x = np.asarray(file.trace_axis(index))
            for position, channel in enumerate(channels):
                if extra["axis"].get("channel") == position:
                    continue
                quantity = _quantity(channel, extra)
                columns, notes = _measured(x, values[position], name)
                label = trace["name"] if sweeps == 1 else f"{trace['name']} {sweep + 1}"
                layout = array_columns(
                    (axis_column(axis) or axis, signal_column(quantity) or quantity),
                    columns,
                    [f"read as a {name} file", *notes],
                    name=label,
                    facts=[("format", name), *first_stated(_FACTS, extra.get)],
                )
                yield Curve(layout, axis, quantity)


def _axis(extra: dict[str, Any]) -> str:
    """The axis as a header would name it: `wavenumber (1/cm)`, or as the file does where it is unknown."""
    axis = extra["axis"]
    quantity, unit = axis.get("quantity") or "x", axis.get("unit")
    if quantity in _SPECTRAL and unit:
        return f"{quantity} ({unit})"
    if quantity == "x":  # the text of a .sp file, as `Wavenumber`
        return str(extra.get("x_units_text") or unit or "")
    return quantity.replace("_", " ") + (f" ({unit})" if unit else "")


def _quantity(channel: dict[str, Any], extra: dict[str, Any]) -> str:
    """The quantity of a channel as a header would name it."""
    name, unit = channel["name"], channel.get("unit")
    if name == "percent":
        return "signal %"  # SPC states percent without the quantity
    if name in _OF_QUANTITY:
        return f"{_OF_QUANTITY[name]} (%)" if unit == "%" else _OF_QUANTITY[name]
    text = str(extra.get("y_units_text") or "")
    if recognise(text).role in ("R", "T"):
        return text
    return "relative intensity" if name == "intensity" and not text else text or name.replace("_", " ")


def _measured(x: np.ndarray, y: np.ndarray, name: str) -> tuple[Sequence[np.ndarray], list[str]]:
    """The columns without points that JASCO marks as not measured, and a note on these."""
    if x.shape != y.shape:
        raise DataError(
            f"is a {name} file of {y.size} values for an axis of {x.size} points; export it as CSV"
        )
    invalid = (y < 0) & (y > _JASCO_INVALID) if name == _FORMATS["jws"] else np.zeros(y.shape, dtype=bool)
    notes = [f"{invalid.sum()} points marked as not measured left out"] if invalid.any() else []
    if invalid.all():
        raise DataError(f"is a {name} file without a measured point; export it again")
    return (x[~invalid], y[~invalid]), notes


def procspec(content: bytes) -> list[Table] | None:
    """Return the processed spectrum of an Ocean Optics ProcSpec file, or None for another format.

    It is a zip of `ps_N.xml`, OOISignatures.xml and OOIVersion.txt. The XML is a `ProcessedSpectrum` of
    SpectraSuite, with the wavelengths in nm (`channelWavelengths`) and the processed values
    (`processedPixels`) as lists of `double`, and has characters that XML does not allow, which are left out.
    No part is unpacked to disk; entities and document types are refused. The layout is that of the readers
    of lightr and Veusz.

    Raises DataError where defusedxml is absent, for a damaged file, and for one that is too large to unpack.
    """
    if not content.startswith(b"PK\x03\x04"):
        return None
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [info for info in archive.infolist() if _MEMBER.fullmatch(info.filename)]
            if not members or len(archive.infolist()) > _MOST_MEMBERS:
                return None
            documents = [_unpacked(archive, info) for info in members]
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError, ValueError) as e:
        if isinstance(e, DataError):
            raise
        if not _ANYWHERE.search(content):
            return None
        raise DataError(
            f"is an {_PROCSPEC} file that cannot be unpacked ({_plain(str(e))}); copy it again"
        ) from None
    return readable([_processed(_parsed(document)) for document in documents])


def _unpacked(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    """The content of a member. Raises DataError for one that is too large, before it is unpacked."""
    document = b""
    too_large = info.file_size > LARGEST_XML or info.file_size > MOST_RATIO * max(info.compress_size, 1)
    if not too_large:
        with archive.open(info) as member:
            document = member.read(LARGEST_XML + 1)  # the size that the directory states may be wrong
    if too_large or len(document) > LARGEST_XML:
        raise DataError(
            f"is an {_PROCSPEC} file whose {info.filename} unpacks to {info.file_size} bytes, which "
            "no spectrum has; export the spectrum as text"
        )
    return document


def _parsed(document: bytes) -> Element:
    absent = f"is an {_PROCSPEC} file, which needs the package", "; or export the spectrum as text"
    damaged = decoding(f"is an {_PROCSPEC} file whose XML cannot be read", "export the spectrum as text")
    with needs("formats", *absent, DataError), damaged:
        from defusedxml.ElementTree import fromstring

        return fromstring(_UNPRINTABLE.sub(b"", document), forbid_dtd=True)


def _plain(error: str) -> str:
    """The text of an error in one line."""
    return " ".join(error.split())[:200]


def _processed(root: Element) -> Curve:
    wavelength = _doubles(root, "channelWavelengths")
    processed = _doubles(root, "processedPixels")
    values = processed if processed.size else _doubles(root, "pixelValues")
    if not wavelength.size or wavelength.size != values.size:
        raise DataError(
            f"is an {_PROCSPEC} file of {wavelength.size} wavelengths and {values.size} processed "
            "values; export the spectrum as text"
        )
    quantity = "counts (the file has no processed spectrum)"
    if processed.size:
        words = set()
        for element in root.iter():
            stated = [element.tag, element.get("class", "")]
            if _MODE_TAG.search(element.tag) and len(element) == 0:
                stated.append(element.text or "")
            words |= {mode for mode, pattern in _MODES.items() if any(map(pattern.search, stated))}
        quantity = words.pop() if len(words) == 1 else "intensity"  # where the file does not state one alone
    name = signal_column(quantity) or quantity
    model = (root.findtext(".//spectrometerClass") or "").rpartition(".")[2]
    serial = root.findtext(".//spectrometerSerialNumber") or ""
    facts = [("format", _PROCSPEC)]
    if instrument := f"{model} {serial}".strip():
        facts.append(("instrument", instrument))
    milliseconds = root.findtext(".//milliTime") or ""
    if milliseconds.isdigit() and len(milliseconds) < 15:
        date = datetime.fromtimestamp(int(milliseconds) / 1000, UTC)
        facts.append(("date", date.strftime("%Y-%m-%d %H:%M:%S UTC")))
    # SpectraSuite shows R and T in percent, but the file does not say so
    name = f"{name} (not stated)" if name in ("R", "T") else name
    layout = array_columns(
        ("wavelength (nm)", name),
        (wavelength, values),
        [f"read as an {_PROCSPEC} file"],
        name=name,
        facts=facts,
    )
    return Curve(layout, "wavelength (nm)", quantity)


def _doubles(root: Element, tag: str) -> np.ndarray:
    """The numbers of the first element of this name that has some."""
    for element in root.iter(tag):
        texts = [child.text or "" for child in element.iter("double")]
        if texts:
            try:
                return np.array([float(text) for text in texts])
            except ValueError as error:
                raise DataError(f"{tag} has no number ({error}); export the spectrum as text") from None
    return np.empty(0)
