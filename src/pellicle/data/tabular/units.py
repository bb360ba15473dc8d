"""Units of files, converted to nm, degrees and fractions.

Plain constants instead of a unit library: importing one would take longer than reading the file.
"""

import numpy as np

HC_EV_NM = 6.62607015e-34 * 299792458 / 1.602176634e-19 * 1e9
"""hc/e in eV nm, exact in the SI of 2019 (h = 6.62607015e-34, c = 299792458, e = 1.602176634e-19)."""

THZ_NM = 299792458 / 1e12 * 1e9
"""c in THz nm."""

WAVELENGTH_UNITS = ("nm", "um", "A", "eV", "cm-1", "THz")
SIGNAL_UNITS = ("fraction", "percent", "absorbance")
BITS = ("8-bit", "16-bit")
"""Units of coded colours."""

_WAVELENGTH_SPELLINGS = {
    "nm": ("nm", "nanometer", "nanometers", "nanometre", "nanometres"),
    "um": ("um", "micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres"),
    "A": ("a", "å", "ang", "angstrom", "angstroms", "ångström", "ångstrom"),
    "eV": ("ev",),
    "cm-1": ("cm-1", "1/cm", "cm^-1", "cm**-1", "cm⁻¹", "cm−1", "/cm", "cm^{-1}", "percm"),
    "THz": ("thz", "terahertz"),
}
_SIGNAL_SPELLINGS = {
    "percent": ("%", "percent", "pct", "perc", "%t", "%r"),
    "fraction": ("fraction", "frac", "1", "-", "", "0-1", "0..1", "unitless", "dimensionless"),
    "absorbance": ("absorbance", "od", "opticaldensity"),
}
_BRDF_SPELLINGS = {"1/sr": ("1/sr", "sr-1", "sr^-1", "sr**-1", "sr⁻¹", "sr−1", "/sr", "persr")}
_ANGLE_SPELLINGS = {"deg": ("deg", "degree", "degrees", "°", "º")}


def _lookup(spellings: dict[str, tuple[str, ...]], text: str) -> str | None:
    plain = text.strip().lower().replace(" ", "").replace("µ", "u").replace("μ", "u")
    spelt = (plain, plain.rstrip("."))  # Shimadzu writes `nm.`
    return next((unit for unit, known in spellings.items() if set(spelt) & set(known)), None)


def wavelength_unit(text: str) -> str | None:
    """Return the member of `WAVELENGTH_UNITS` that `text` spells (`µm`, `1/cm`, `Angstrom`, ...), or None."""
    return _lookup(_WAVELENGTH_SPELLINGS, text)


def signal_unit(text: str) -> str | None:
    """Return the member of `SIGNAL_UNITS` that `text` spells (`%`, `-`, ...), or None.

    `abs` is none: some programs write it for absolute, others for absorbance.
    """
    return _lookup(_SIGNAL_SPELLINGS, text)


def colour_unit(text: str) -> str | None:
    """Return the unit of a spectrum's signal or of colours that `text` spells, else None."""
    return text if text in BITS else signal_unit(text)


def angle_unit(text: str) -> str | None:
    """Return "deg" if `text` spells degrees, else None."""
    return _lookup(_ANGLE_SPELLINGS, text)


def brdf_unit(text: str) -> str | None:
    """Return "1/sr" if `text` spells the unit of a BRDF, else None."""
    return _lookup(_BRDF_SPELLINGS, text)


def to_nm(values: np.ndarray, unit: str) -> np.ndarray:
    """Convert positive `values`, of any shape, in one of `WAVELENGTH_UNITS` to wavelengths in nm."""
    match unit:
        case "nm":
            return values
        case "um":
            return values * 1e3
        case "A":
            return values / 10
        case "eV":
            return HC_EV_NM / values
        case "cm-1":
            return 1e7 / values
        case "THz":
            return THZ_NM / values
    raise ValueError(f"`unit`: expected one of {', '.join(WAVELENGTH_UNITS)}, got {unit!r}")
