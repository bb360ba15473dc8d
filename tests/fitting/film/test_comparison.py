"""Two descriptions compared on spectra of several angles, whose rows alternate between the angles."""

import numpy as np
import pytest

import pellicle as pl


@pytest.mark.slow  # compiles fits of its own
def test_residuals_count_along_the_sweep_of_each_angle():
    """Slow errors of one sign at one angle and of the other at the next look like noise in file order."""
    nm, angles = np.linspace(450.0, 800.0, 32), np.array([20.0, 40.0, 50.0, 60.0])
    substrate = pl.dispersion.Constant(3.9, 0.02)
    wavelength, angle = (x.ravel() for x in np.meshgrid(nm, angles, indexing="ij"))
    random = np.random.default_rng(3)
    values = np.empty((32, 4))
    for i, own in enumerate(angles.tolist()):
        scene = pl.Scene(pl.Layer(1.46, 420.0), substrate, light=pl.Light(angle=own))
        values[:, i] = pl.simulate(scene, nm).values + 0.01 * (-1) ** i * (1 + (nm - 450) / 350)
    values += random.normal(0.0, 0.001, values.shape)
    spectrum = pl.Spectrum(wavelength, values.ravel(), "R", angle=angle)
    scenes = {f"{n:g}": pl.Scene(pl.Layer(n, pl.Free(380.0, 460.0)), substrate) for n in (1.46, 1.5)}
    found = pl.compare(spectrum, scenes)
    assert found.best.name == "1.46"
    # the errors of a sweep have one sign: its 32 points count as a few
    assert found.effective_points < 128 / 5
    assert found.effective_points == pytest.approx(found.best.fit.effective_points, rel=0.02)
