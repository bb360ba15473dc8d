"""Figures of spheres: what they are made of, their exposure and their display."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import UsageError
from pellicle.reporting import renderings
from pellicle.reporting.renderings import display, exposure, objects
from pellicle.simulation.environment import Rendering

PNG = b"\x89PNG"


def test_one_exposure_for_several_renderings():
    coverage = np.ones((4, 4))
    dark, bright = (Rendering(np.full((4, 4, 3), value), coverage) for value in (0.1, 4.0))
    assert exposure(dark) == pytest.approx(10.0)
    assert exposure(dark, bright) == pytest.approx(0.25)
    assert exposure(Rendering(np.zeros((4, 4, 3)), coverage)) == 1.0
    np.testing.assert_allclose(display(bright), 1.0, atol=1e-6)


def test_the_background_shows_through_what_the_sphere_leaves():
    rendering = Rendering(np.full((1, 2, 3), 0.5), np.array([[1.0, 0.25]]))
    inside, limb = display(rendering, 1.0, background=0.2)[0, :, 0]
    assert inside == pytest.approx(0.7354, abs=1e-3)  # sRGB of 0.5, IEC 61966-2-1
    assert limb == pytest.approx(0.25 * inside + 0.75 * 0.2)


@pytest.mark.slow  # renders spheres
def test_figures_are_written(tmp_path, monkeypatch, refuses):
    film = pl.Scene(pl.Layer(1.33, 100.0), 1.0)
    objects(pl.Scene(pl.Layer(2.0, 100.0), 1.5), tmp_path / "balls.png", "balls", (50.0, 100.0), size=9)
    objects(film, tmp_path / "bubbles.png", "bubble", (300.0, 100.0), size=9)
    assert all((tmp_path / name).read_bytes().startswith(PNG) for name in ("balls.png", "bubbles.png"))
    monkeypatch.setattr(renderings, "bubble", lambda *_: pytest.fail("drawn before it is refused"))
    for name, kind, words in (
        ("bubbles.png", "bubble", "exists"),
        ("nowhere/bubbles.png", "bubble", "there is no folder"),
        ("balls.jpg", "balls", r"\.png"),
    ):
        refuses(UsageError, words, objects, film, tmp_path / name, kind, (300.0,), size=9)
