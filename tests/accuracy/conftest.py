"""Small cases: few wavelengths, few draws."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.accuracy.case import Case, case

NM = np.linspace(420.0, 740.0, 9)


def few(scene: pl.Scene, wavelength: np.ndarray = NM, draws: int = 3) -> Case:
    """A case with few draws."""
    found = case(scene, wavelength)
    return found._replace(draws=found.draws[:draws])


@pytest.fixture(scope="session")
def oblique() -> Case:
    """A dispersing film that absorbs, seen at 60 degrees, its thickness and k free."""
    film = pl.Layer(
        pl.dispersion.Shifted(pl.dispersion.Cauchy(1.9, 12000.0), k=pl.Free(0.0, 0.2, start=0.05)),
        thickness=pl.Free(50.0, 400.0, start=120.0),
    )
    light = pl.Light(angle=60.0)
    return few(pl.Scene(film, substrate=pl.dispersion.Constant(1.5, 0.4), light=light))
