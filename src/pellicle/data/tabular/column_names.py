"""Names of columns, in lower case, in the languages that instruments write."""

from pellicle.signals.registry import KINDS

NAMES: dict[str, tuple[str, ...]] = {
    "wavelength": (
        *("wavelength", "wavelengths", "wave length", "wave", "wl", "lambda", "lam", "λ"),
        *("wellenlänge", "wellenlaenge", "longueur d'onde", "longueur d’onde", "longitud de onda"),
        *("lunghezza d'onda", "lunghezza d’onda", "comprimento de onda", "golflengte", "波長", "波长"),
    ),
    "energy": (
        *("energy", "photon energy", "photon_energy", "energie", "photonenergie"),
        *("e(ev)", "e (ev)", "e[ev]", "e [ev]", "e/ev", "e / ev", "e_ev"),
    ),
    "wavenumber": (
        *("wavenumber", "wavenumbers", "wave number", "wellenzahl", "nombre d'onde", "nombre d’onde"),
        *("número de onda", "波数"),
    ),
    "frequency": ("frequency", "frequenz"),
    "R": (
        *("r", "reflectance", "reflectivity", "reflection", "reflexion", "réflexion", "réflectance"),
        *("reflexionsgrad", "reflektivität", "reflektanz", "reflectancia", "riflettanza", "反射率"),
    ),
    "Rs": ("rs", "r_s", "reflectance_s"),
    "Rp": ("rp", "r_p", "reflectance_p"),
    "T": (
        *("t", "transmittance", "transmissivity", "transmission", "transmissionsgrad"),
        *("transmitancia", "trasmittanza", "透過率", "透过率"),
    ),
    "Ts": ("ts", "t_s", "transmittance_s"),
    "Tp": ("tp", "t_p", "transmittance_p"),
    "absorbance": (
        *("-log(t)", "-log10(t)", "log(1/t)"),
        *("a", "abs", "abs.", "absorbance", "optical density", "optical_density", "od", "o.d."),
        *("extinktion", "absorbanz", "absorbancia", "assorbanza", "吸光度"),
    ),
    "log(1/R)": ("log(1/r)", "-log(r)", "-log10(r)", "log 1/r", "log_1_r", "apparent absorbance"),
    "intensity": ("intensity", "relative intensity", "relative_intensity"),
    "counts": ("counts", "raw"),
    "processed": ("processed",),
    "sample counts": ("sample counts",),
    "reference counts": ("reference counts",),
    "dark counts": ("dark counts",),
    "sigma": ("sigma", "σ"),
    "angle": ("angle", "aoi", "angle of incidence", "angle_of_incidence"),
    "azimuth": ("azimuth", "sample azimuth", "sample_azimuth", "sample rotation"),
    "psi": ("psi", "ψ"),
    "delta": ("delta", "δ"),
    "sigma_psi": ("sigma_psi", "psi_sigma", "psi_err", "psi_error", "err_psi"),
    "sigma_delta": ("sigma_delta", "delta_sigma", "delta_err", "delta_error", "err_delta"),
    "depolarisation": ("depolarisation", "depolarization", "depol"),
    "sigma_depolarisation": (
        "sigma_depolarisation",
        "sigma_depolarization",
        "sigma_depol",
        "depolarisation_sigma",
        "depolarization_sigma",
        "depol_sigma",
        "depol_err",
        "depol_error",
        "err_depol",
    ),
    "N": ("n",),
    "C": ("c",),
    "S": ("s",),
    "alpha": ("alpha", "α"),
    "beta": ("beta", "β"),
    "tan_psi": ("tan_psi", "tan(psi)", "tan psi", "tanpsi", "tan(ψ)", "tan ψ", "tanψ"),
    "cos_delta": ("cos_delta", "cos(delta)", "cos delta", "cosdelta", "cos(δ)", "cos δ", "cosδ"),
    "analyser": ("analyser", "analyzer", "analyser angle", "analyzer angle"),
    "theta_i": ("theta_i", "θ_i"),
    "phi_i": ("phi_i", "φ_i"),
    "theta_o": ("theta_o", "θ_o"),
    "phi_o": ("phi_o", "φ_o"),
    "value": ("value", "brdf"),
    "G": ("g",),
    "B": ("b",),
    "sigma_R": ("sigma_r",),
    "sigma_G": ("sigma_g",),
    "sigma_B": ("sigma_b",),
}
"""Names of each role; a column of any other name is ignored, with a note."""
_SIGMA_OF = ("sigma_{}", "{}_sigma", "{}_err", "{}_error", "err_{}")
_PLACES = tuple(f"{i}{j}" for i in range(1, 5) for j in range(1, 5))
MUELLER = tuple(f"m{place}" for place in _PLACES)
"""Roles of the elements of a Mueller matrix, m11 to m44."""
NAMES |= {f"m{place}": (f"m{place}", f"mm{place}", f"m_{place}", f"m_{{{place}}}") for place in _PLACES}
NAMES |= {
    f"sigma_{element}": tuple(form.format(f"{m}{element[1:]}") for m in ("m", "mm") for form in _SIGMA_OF)
    for element in MUELLER
}
RATIO_COLUMNS = tuple(f"{angle}_{ratio}" for ratio in ("ane", "aps", "asp") for angle in ("psi", "delta"))
"""Roles of generalised Ψ and Δ, those of each ratio side by side."""
for _role in RATIO_COLUMNS:
    NAMES[_role] = (_role, _role.replace("_", " "), "{}({})".format(*_role.split("_")))
    NAMES[f"sigma_{_role}"] = tuple(form.format(_role) for form in _SIGMA_OF)
NAMES |= {word: kind.names for word, kind in KINDS.items() if kind.names}
FOREIGN = (
    *("absorptance", "cd", "circular dichroism", "ellipticity", "emission", "f(r)", "fluorescence"),
    *("irradiance", "k/s", "kubelka-munk", "mdeg", "photoluminescence", "pl", "pl intensity", "power"),
    *("radiance", "raman", "raman intensity", "scope", "single beam"),
    *("absorption coefficient", "attenuation", "insertion loss", "1-r", "1-t", "1-r-t", "-ln(t)", "-ln(r)"),
    *("absorption (%)", "absorption [%]"),  # a share, as absorptance
    *("re(rho)", "im(rho)", "re(ρ)", "im(ρ)", "re_rho", "im_rho"),
    *("is", "ic", "ic'"),  # of a phase-modulated ellipsometer
)
"""Names of quantities that are not read: neither R nor T, psi and delta, nor elements of a Mueller matrix."""

COUNTERS = ("index", "no", "no.", "nr", "nr.", "number", "point", "pixel", "row", "time", "time (s)")
"""Names of columns that count rows or give times, which are no signals."""
