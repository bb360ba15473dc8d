"""Several spectra of one sample, fitted together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tmm
from scipy.optimize import least_squares

import pellicle as pl
from pellicle.errors import UsageError
from pellicle.fitting.fit import labels
from pellicle.optics.dispersion import CauchyUrbach

BRUSH = Path(__file__).parents[2] / "measurements" / "ellipsometry" / "19-1-1.dat"
WAVELENGTH = np.linspace(400.0, 900.0, 60)
TRUTH = (150.0, 2.0, 2e4, 0.1, 0.3)  # thickness, A, B, k0 at 2.5 eV, Eu
NAMES = ("thickness", "A", "B", "k0", "Eu")
SIGMA = {"R": 0.002, "T": 0.001}


def plate(signal: str, numbers=TRUTH) -> np.ndarray:
    """R or T of an absorbing film on a glass plate, by the package tmm (S. J. Byrnes, arXiv:1603.02720)."""
    thickness, a, b, k0, eu = numbers
    energy = 1239.841984 / WAVELENGTH
    index = a + b / WAVELENGTH**2 + 1j * k0 * np.exp((energy - 2.5) / eu)
    stack, kinds = [np.inf, thickness, 1e6, np.inf], ["i", "c", "i", "i"]
    at = zip(index, WAVELENGTH, strict=True)
    return np.array([tmm.inc_tmm("s", [1, n, 1.52, 1], stack, kinds, 0, nm)[signal] for n, nm in at])


@pytest.fixture(scope="module")
def spectra() -> list[pl.Spectrum]:
    """R and T with their own noise."""
    rng = np.random.default_rng(1)
    return [
        pl.Spectrum(
            WAVELENGTH,
            plate(signal) + rng.normal(0, sigma, 60),
            signal,
            sigma=np.full(60, sigma),
            path=f"film_{signal}.csv",
        )
        for signal, sigma in SIGMA.items()
    ]


@pytest.fixture(scope="module")
def both(spectra) -> pl.Fit:
    free = pl.Free
    film = CauchyUrbach(
        free(None, 1.6, 2.6), free(None, 0.0, 5e4), 0.0, free(None, 0.0, 1.0), free(None, 0.1, 1.0), 2.5
    )
    return pl.fit(spectra, pl.Scene(pl.Layer(film, free(None, 20, 600)), pl.Substrate(1.52, "air")))


def test_reflectance_and_transmittance_as_an_independent_fit(both, spectra):
    """The same minimum and errors as scipy's least squares of tmm's films, started at the truth."""
    size = np.array([100.0, 1.0, 1e4, 0.1, 0.1])

    def residual(scaled):
        return np.concatenate([(s.values - plate(s.signal, scaled * size)) / s.sigma for s in spectra])

    found = least_squares(residual, TRUTH / size, xtol=1e-12, ftol=1e-12)
    stderr = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac))) * size
    assert both.status == "converged"
    for name, value, error, truth in zip(NAMES, found.x * size, stderr, TRUTH, strict=True):
        assert abs(both[name].value - value) < 1e-2 * error
        assert both[name].stderr == pytest.approx(error, rel=1e-2)
        assert abs(both[name].value - truth) < 4 * error
    assert both.chi2_reduced == pytest.approx(2 * found.cost / (120 - 5), rel=1e-6)


def test_a_part_for_each_spectrum(both, spectra):
    assert [part.name for part in both.parts] == ["film_R", "film_T"]
    for part, spectrum in zip(both.parts, spectra, strict=True):
        assert part.rms == pytest.approx(np.sqrt(np.mean((spectrum.values - part.curve.model) ** 2)))
        assert part.plan.signal == spectrum.signal
    assert both.rms == pytest.approx(np.sqrt(np.mean([part.rms**2 for part in both.parts])))
    with pytest.raises(ValueError, match="joint fit of 2 spectra"):
        both.curve  # noqa: B018


def test_a_file_in_two_is_the_whole_file():
    """Ψ and Δ of a real polymer brush: every other angle apart, with a σ that both know.

    The minimum may move by a little of its error: each half counts the correlation of its own residuals.
    """
    whole = pl.read_spectrum(BRUSH, noise=0.1)
    scene = pl.Scene(pl.Layer(1.45, pl.Free(lower=1, upper=200)), "Si")
    halves = [
        replace(whole, **{name: getattr(whole, name)[first::2] for name in ARRAYS}, path=f"{first}.dat")
        for first in (0, 1)
    ]
    one, two = pl.fit(whole, scene), pl.fit(halves, scene)
    assert abs(two["thickness"].value - one["thickness"].value) < 0.01 * one["thickness"].stderr
    assert two["thickness"].stderr == pytest.approx(one["thickness"].stderr, rel=1e-5)
    assert two.chi2_reduced == pytest.approx(one.chi2_reduced, rel=1e-7)
    assert two.rms == pytest.approx(one.rms, rel=1e-4)
    assert two.status == one.status


ARRAYS = ("wavelength", "values", "sigma", "angle", "delta", "delta_sigma", "lines")


def oxide(thickness: float = 100.0, scale: float = 1.0) -> pl.Spectrum:
    values = scale * np.asarray(pl.reflectance(WAVELENGTH, thickness, "SiO2", "Si"))
    noise = np.random.default_rng(2).normal(0, 0.002, 60)
    return pl.Spectrum(WAVELENGTH, values + noise, "R", sigma=np.full(60, 0.002), path=f"{thickness:g}nm.csv")


SCENE = pl.Scene(pl.Layer("SiO2", pl.Free(lower=10, upper=400)), "Si", instrument=pl.Instrument(scale="free"))


def test_ellipsometry_beside_a_reflectance_of_unknown_scale():
    """Of one scene for both, only the reflectance has a scale; rms of fractions and degrees is none."""
    psi, delta = pl.ellipsometry(WAVELENGTH, 100.0, "SiO2", "Si", angle=70.0)
    rng = np.random.default_rng(3)
    ellipsometric = pl.Spectrum(
        WAVELENGTH,
        np.asarray(psi) + rng.normal(0, 0.02, 60),
        "psi-delta",
        sigma=np.full(60, 0.02),
        angle=np.full(60, 70.0),
        delta=np.asarray(delta) + rng.normal(0, 0.05, 60),
        delta_sigma=np.full(60, 0.05),
        path="oxide.csv",
    )
    found = pl.fit([ellipsometric, oxide(scale=1.1)], SCENE)
    assert found.status == "converged"
    assert abs(found["thickness"].value - 100.0) < 4 * found["thickness"].stderr < 0.1
    scale = found["instrument.scale.100nm"]
    assert abs(scale.value - 1.1) < 4 * scale.stderr < 0.02
    assert [p.name for p in found.free] == ["thickness", "instrument.scale.100nm"]
    assert found.rms is None


def test_a_misfit_names_the_file():
    scene = pl.Scene(pl.Layer("SiO2", pl.Free(lower=10, upper=400)), "Si")
    right, wrong = oxide(100.0), oxide(130.0)
    found = pl.fit([right, replace(wrong, sigma=np.full(60, 0.02))], scene)
    assert found.status == "misfit"
    assert found.parts[1].name in found.verdict
    assert found.parts[0].name not in found.verdict


def test_a_spectrum_of_another_sample_is_not_given_up_in_silence():
    """Without σ its noise would grow with its residuals until it counts for nothing."""
    scene = pl.Scene(pl.Layer("SiO2", pl.Free(lower=10, upper=400)), "Si")
    found = pl.fit([replace(oxide(100.0), sigma=None), replace(oxide(250.0), sigma=None)], scene)
    assert found.status == "misfit"


def test_what_tells_spectra_apart():
    r = pl.Spectrum(WAVELENGTH, np.full(60, 0.1), "R", path="a/film.v2.csv")
    t = replace(r, signal="T")
    assert labels([r]) == [""]
    assert labels([r, replace(t, path="b.csv")]) == ["film_v2", "b"]
    assert labels([r, t]) == ["film_v2-R", "film_v2-T"]
    assert labels([r, r]) == ["film_v2-1", "film_v2-2"]
    assert labels([replace(r, path=""), replace(t, path="")]) == ["R", "T"]
    assert "thickness" not in labels([r, replace(t, path="thickness.csv")])


@pytest.mark.parametrize(
    ("spectra", "scenes", "said"),
    [
        ([], SCENE, "no spectrum"),
        ([oxide(), oxide()], [SCENE], "2 spectra need as many scenes"),
        ([oxide(), oxide()], [SCENE, pl.Scene(pl.Layer("SiO2", 1.0), "Si")], "same layers"),
        ([oxide(), oxide()], [SCENE, pl.Scene(SCENE.layers, "BK7")], "same layers, ambient and substrate"),
    ],
)
def test_what_is_no_joint_fit(spectra, scenes, said):
    with pytest.raises(UsageError, match=said):
        pl.fit(spectra, scenes)
