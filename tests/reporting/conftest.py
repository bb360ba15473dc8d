"""A fit written down by hand: what reports and figures are made of."""

import dataclasses
import math

import numpy as np
import pytest

from pellicle.data.brdf_samples import BrdfSamples
from pellicle.data.spectrum import Spectrum
from pellicle.effects.surface_plan import exact
from pellicle.fitting.curves import BrdfCurve, Curve
from pellicle.fitting.result import Estimate, Fit, LayerTest, Part, Profile, Rival, Status
from pellicle.forward_model.plan import Plan, Row
from pellicle.scene.surface import Surface, surface_view
from tests.made_fits import made_fit


@pytest.fixture
def fit() -> Fit:
    """A free thickness and index, a fixed B, a drifting scale and an offset; one near rival."""
    rows = (
        Row("absorption", False, "the layer has no extinction, and none is free"),
        Row("back-face", True, "the substrate is a plate; its back face adds incoherently"),
    )
    nm = np.linspace(400.0, 800.0, 41)
    model = 0.3 + 0.1 * np.cos(nm / 30)
    noise = 0.002 * np.sin(nm)
    above = np.zeros((5, 5))
    above[np.triu_indices(5, 1)] = [0.62, 0.49, -0.97, 0.1, 0.2, 0.3, 0.0, -0.88, 0.93, 0.4]
    zero = np.zeros(41)
    curve = Curve(nm, model + noise, zero + 0.002, model, zero + 1.33, zero, zero + 0.0012, zero)
    data = Spectrum(nm, model + noise, "R", path="/data/film.csv", sha256="ab" * 32)
    nuisances = ("scale", 4.5, 0.4), ("scale_1", 1.5, 0.6), ("offset", 0.3, 0.02)
    return made_fit(
        Part("", data, curve, Plan(rows, "R", "unpolarised"), 0.00141, 1.02, 12.0),
        status=Status.AMBIGUOUS,
        verdict="The data do not determine thickness: 486.28 nm fits best, but 242.87 nm fits nearly"
        " as well.",
        parameters=(
            Estimate("thickness", 486.28, 3.6, "nm", 10.0, 3000.0, True),
            Estimate("A", 1.324, 0.0012, "", 1.2, 2.8, True),
            *(Estimate(f"instrument.{x}", *xs, "", -math.inf, math.inf, True) for x, *xs in nuisances),
            Estimate("B", 3102.06, 0.0, "nm^2", 3102.06, 3102.06, False),
        ),
        rivals=(Rival({"A": 1.33, "thickness": 242.87}, 0.69), Rival({"A": 1.4, "thickness": 963.57}, 14.2)),
        correlation=above + above.T + np.eye(5),
        warnings=("SiO2 has no data for k: it is taken as transparent, which its source does not say.",),
        profile=Profile(np.linspace(10.0, 3000.0, 60), np.linspace(5.0, 400.0, 60)),
        seconds=0.42,
    )


@pytest.fixture
def curved(fit) -> Fit:
    """The fit with the curves of its rivals, which differ from the best by a constant."""
    [part] = fit.parts
    curves = [(dataclasses.replace(part.curve, model=part.curve.model + shift),) for shift in (0.01, 0.02)]
    rivals = [dataclasses.replace(r, curves=c) for r, c in zip(fit.rivals, curves, strict=True)]
    return dataclasses.replace(fit, rivals=tuple(rivals))


def ellipsometric(fit: Fit, wavelength, angle, with_part, **curve) -> Fit:
    """`fit` as if it were one of Ψ and Δ at these points; Δ passes 360 degrees, the data before the model."""
    size = np.size(wavelength)
    psi, delta = np.linspace(20.0, 40.0, size), np.linspace(300.0, 420.0, size) % 360
    turned = (delta + 2.0) % 360
    spectrum = Spectrum(
        wavelength, psi + 0.1, "psi-delta", angle=angle, path="/data/film.csv", sha256="ab" * 32, delta=turned
    )
    numbers = {"sigma": 0.1, "n": 1.46, "k": 0.0, "n_stderr": 0.001, "k_stderr": 0.0}
    arrays = {name: np.full(size, number) for name, number in numbers.items()}
    deltas = {"delta_data": spectrum.delta, "delta_model": delta}
    made = Curve(spectrum.wavelength, data=spectrum.values, model=psi, **deltas, **(arrays | curve))
    return with_part(dataclasses.replace(fit, rms=0.123), data=spectrum, curve=made, rms=0.123)


@pytest.fixture
def spectroscopic(fit, with_part) -> Fit:
    """Ψ and Δ at 20 wavelengths and two angles."""
    nm, angle = np.repeat(np.linspace(400.0, 800.0, 20), 2), np.tile([65.0, 75.0], 20)
    return ellipsometric(fit, nm, angle, with_part)


@pytest.fixture
def angular(fit, with_part) -> Fit:
    """Ψ and Δ at one wavelength and eleven angles."""
    return ellipsometric(fit, np.full(11, 658.0), np.linspace(50.0, 70.0, 11), with_part)


@pytest.fixture
def as_ellipsometry(fit, with_part):
    """Makes a fit of Ψ and Δ at any wavelengths (nm) and angles (degrees)."""
    return lambda wavelength, angle: ellipsometric(fit, wavelength, angle, with_part)


@pytest.fixture
def brdf_fit() -> Fit:
    """Three samples in the plane of incidence, where the half angle is half the difference of the angles."""
    theta_o = np.array([10.0, 30.0, 50.0])
    directions = np.full(3, 30.0), np.zeros(3), theta_o, np.full(3, 180.0)
    values = np.array([[0.1], [1.0], [0.2]])
    samples = BrdfSamples(*directions, values, ("value",), np.full((3, 1), 0.05))
    surface = Surface("microfacet-film", {"thickness": 40.0, "n": 1.5, "base_n": 2.7}, (550.0,))
    curve = BrdfCurve(samples.values + 0.1, np.full((3, 1), -2.0))
    plan = exact(surface_view(surface, samples))
    part = Part("", samples, curve, plan, rms=1.0, chi2_reduced=1.0, effective_points=3.0)
    return made_fit(part, status=Status.MISFIT, scene=surface, layer_test=LayerTest(False, 1.0, (), "linear"))
