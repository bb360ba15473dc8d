"""Data files that are dropped on the explorer, or lie in its folder."""

import tempfile
from base64 import b64decode
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pellicle.data.read_spectrum import read_spectra
from pellicle.data.spectrum import Spectrum
from pellicle.errors import DataError, UsageError
from pellicle.explorer.programs import MOST, Curve, measured_angles, named, thinned

LARGEST_FILE = 20_000_000
"""Bytes of the largest data file."""
_LONGEST_NAME = 120


def measured_spectra(body: Mapping[str, Any], folder: Path | None, signal: str) -> list[Spectrum]:
    """Read the spectra of a request: `name` with `text` or `base64`, or `file`, one in the folder.

    A file that does not state its signal has that of the scene. **Raises:** DataError or UsageError in one
    sentence.
    """
    if "file" in body:
        path = _inside(folder, body["file"])
        return _read(path, path.name, signal)
    name, content = _content(body)
    with tempfile.TemporaryDirectory(prefix="pellicle-") as place:
        path = Path(place) / name
        path.write_bytes(content)
        return _read(path, name, signal)


def _content(body: Mapping[str, Any]) -> tuple[str, bytes]:
    name = body.get("name")
    if not isinstance(name, str):
        raise UsageError("a file needs a name")
    name = "".join(x for x in name.replace("\\", "/").rpartition("/")[2] if x.isprintable()).strip(". ")
    name = name[-_LONGEST_NAME:] or "data.csv"
    encoded = body.get("base64")
    given = body.get("text") if encoded is None else encoded
    if not isinstance(given, str):
        raise UsageError(f"{name}: a file needs its text, or its bytes in base64")
    try:
        content = given.encode() if encoded is None else b64decode(given, validate=True)
    except ValueError:
        form = "Unicode text" if encoded is None else "base64"
        raise UsageError(f"{name}: is not {form}") from None
    if len(content) > LARGEST_FILE:
        raise DataError(f"{name}: has more than {LARGEST_FILE // 1_000_000} MB: fit it with pellicle fit")
    return name, content


def _inside(folder: Path | None, name: Any) -> Path:
    """The path of a file in the folder. Raises UsageError for one outside, whether it exists or not."""
    path = None if folder is None or not isinstance(name, str) or "\0" in name else (folder / name).resolve()
    if path is None or folder is None or not path.is_relative_to(folder):
        raise UsageError(f"{name}: only files in the folder of the recipe can be read")
    if not path.is_file():
        raise DataError(f"{name}: no such file in the folder of the recipe")
    if path.stat().st_size > LARGEST_FILE:
        raise DataError(f"{name}: has more than {LARGEST_FILE // 1_000_000} MB: fit it with pellicle fit")
    return path


def _read(path: Path, name: str, signal: str) -> list[Spectrum]:
    """Read a file whose errors and spectra bear its name without the folder."""
    try:
        try:
            spectra = read_spectra(path)
        except UsageError as error:
            try:
                spectra = read_spectra(path, signal=signal)
            except UsageError:
                raise error from None
            note = f"the file does not say what it is: taken as {signal}, the signal of the scene"
            spectra = [replace(each, notes=(*each.notes, note)) for each in spectra]
    except (UsageError, DataError) as error:
        kind = type(error)
        raise kind(str(error).replace(str(path), name)) from None
    notes = [tuple(note.replace(str(path), name) for note in each.notes) for each in spectra]
    return [replace(each, path=name, notes=own) for each, own in zip(spectra, notes, strict=True)]


def data_curves(spectra: Sequence[Spectrum], against_angle: bool = False) -> list[Curve]:
    """Return the curves of spectra, one for each angle of incidence if they are measured at several.

    Of more than `incidence.MOST` angles some are left out. With `against_angle` there is one curve against
    the angle, and spectra at several wavelengths have none.
    """
    curves = []
    every = measured_angles(spectra)
    for spectrum in spectra:
        columns = {
            q.symbol: q.measured(spectrum) for q in spectrum.kind.quantities if q.array != "depolarisation"
        }
        for rows, x, setting in lines(spectrum, every, against_angle):
            for label, values in columns.items():
                curves.append(Curve(label, x, np.asarray(values)[rows], setting, spectrum.name))
    return curves


def lines(
    spectrum: Spectrum, every: np.ndarray, against_angle: bool
) -> list[tuple[np.ndarray, np.ndarray, str]]:
    """Return the rows of each curve of a spectrum, their abscissa, and the name of their angle.

    `every` has the angles of all spectra; one angle has no name.
    """
    if against_angle:
        if spectrum.angle is None or np.ptp(spectrum.wavelength) > 0:
            return []
        rows = np.argsort(spectrum.angle, kind="stable")
        return [(rows, spectrum.angle[rows], "")]
    if spectrum.angle is None or len(every) < 2:
        return [(np.arange(len(spectrum)), spectrum.wavelength, "")]
    drawn = [(np.flatnonzero(spectrum.angle == angle), named(angle)) for angle in thinned(every)]
    return [(rows, spectrum.wavelength[rows], setting) for rows, setting in drawn if rows.size]


def data_text(spectra: Sequence[Spectrum]) -> list[str]:
    """Sentences on what was read."""
    sentences = []
    for spectrum in spectra:
        nm, angles = spectrum.wavelength, measured_angles([spectrum])
        across = f"from {nm.min():g} to {nm.max():g} nm" if np.ptp(nm) > 0 else f"at {nm[0]:g} nm"
        at = ", ".join(f"{angle:g}" for angle in angles)
        if len(angles) > MOST:
            at = f"{len(angles)} angles from {angles[0]:g} to {angles[-1]:g}"
        about = f"{spectrum.signal}, {len(nm)} points {across}{f', at {at}°' if at else ''}"
        sentences += [f"{spectrum.path}: {about}", *spectrum.notes]
    count = len(measured_angles(spectra))
    if count > MOST and any(np.ptp(spectrum.wavelength) > 0 for spectrum in spectra):
        sentences.append(f"data at {MOST} of {count} angles of incidence are drawn; a fit uses all of them")
    return list(dict.fromkeys(sentences))
