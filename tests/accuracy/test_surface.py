"""The comparison of a surface: which ways there are, and what they are off by."""

import dataclasses

import jax
import numpy as np
import pytest

from pellicle.accuracy import colour_methods
from pellicle.accuracy.case import random_draws
from pellicle.accuracy.colour_methods import COLOUR_METHODS
from pellicle.accuracy.registry import Comparison, Cost, Result
from pellicle.accuracy.surface import BRDF_METHODS, DRAWS, films_of
from pellicle.colour import delta_e2000, lab, sensor
from pellicle.dispersion.empirical import along_the_spectrum
from pellicle.rendering.renderer_methods import RENDERER_METHODS
from pellicle.reporting.cost import text, to_json
from pellicle.scene.free import Free
from pellicle.scene.surface import Surface, surface_view
from pellicle.simulation.brdf import default_directions

from ..airy import airy

STEEL = surface_view(
    Surface("microfacet-film", {"thickness": Free(10, 70), "n": 2.9}), default_directions(), 40
)
PAINT = surface_view(Surface("granier-heidrich", {"thickness": Free(10, 70)}), default_directions(), 40)
BY_NAME = {method.name: method for method in COLOUR_METHODS}


@pytest.fixture(scope="module")
def films():
    with jax.enable_x64(True):
        return films_of(STEEL, random_draws(STEEL, 8))


def by_formula(films):
    """Spectra of these films in steps of 1 nm, (thicknesses, angles, wavelengths)."""
    thickness, cosine = films.numbers["thickness"][:, None, None], np.cos(films.angle)[:, None]
    return airy(sensor().wavelength, thickness, 2.9, 2.7 + 2.8j, cosine)


@pytest.mark.slow
def test_the_error_of_a_method_is_true(films):
    """Against the textbook formula at steps of 1 nm."""
    eye = sensor("1931", "D65")
    true = by_formula(films) @ eye.weights
    ranges = {"points-645-525-445": (1, 10), "uniform-16": (1e-3, 0.2), "table of the film": (0, 0.02)}
    with jax.enable_x64(True):
        for name, (least, most) in ranges.items():
            found = BY_NAME[name].apply(films).run()
            labs = (np.asarray(lab(np.asarray(x, float), eye.white)) for x in (found, true))
            off = np.mean(delta_e2000(*labs))
            assert least < off < most
            assert colour_methods.error(eye, true, found) == pytest.approx(off)


def renderer_errors(films, *names):
    """Errors of rungs from the textbook formula at steps of 1 nm."""
    eye, rungs = sensor(), {method.name: method for method in RENDERER_METHODS}
    true = by_formula(films) @ eye.weights
    with jax.enable_x64(True):
        return [colour_methods.error(eye, true, rungs[name].apply(films).run()) for name in names]


@pytest.mark.slow
def test_renderers_are_rungs(films):
    """glTF leaves out the extinction of steel, which MaterialX knows."""
    gltf, materialx = renderer_errors(films, "glTF, as it is", "MaterialX, as it is")
    assert gltf > 15 > 4 > materialx > 0.5
    free = films._replace(numbers={**films.numbers, "n": np.linspace(2.0, 2.9, 8)})
    assert {method.apply(free) for method in RENDERER_METHODS} == {"its indices are free: it is for one film"}


@pytest.mark.slow
def test_solved_renderers_are_rungs(films):
    gltf, solved = renderer_errors(films, "glTF, as it is", "glTF, solved")
    assert solved < 0.6 * gltf


def test_angles_may_be_spared(films):
    with jax.enable_x64(True):
        exact, few = (BY_NAME[name].apply(films).run() for name in ("uniform-64", "uniform-64 at 16 angles"))
    # 1.04e-4: `film_colour.node_count` asks for 32 angles where 1e-4 is to be kept
    np.testing.assert_allclose(few, exact, atol=2e-4)


def test_what_makes_no_sense_says_why(films):
    absorbing = films._replace(numbers={**films.numbers, "k": np.full(8, 0.1)})
    assert BY_NAME["belcour-barla"].apply(absorbing) == "it has no absorbing layer"
    thick = films._replace(thickest=800.0)
    assert BY_NAME["nodes-6-500"].apply(thick) == "its wavelengths are for films up to 500 nm"
    free = films._replace(numbers={**films.numbers, "n": np.linspace(2.0, 2.9, 8)})
    assert BY_NAME["table of the film"].apply(free) == "its indices are free: it is for one film"
    assert "too few angles" in BY_NAME["uniform-64 at 32 angles"].apply(films)
    assert "defined at three wavelengths only" in films_of(PAINT, random_draws(PAINT, DRAWS))
    each = surface_view(Surface("blinn-phong-film", {}), default_directions(), 8)
    free = dataclasses.replace(each, numbers={**each.numbers, "n": [Free(1.4, 1.5)] * 3})
    assert "unknown between them" in films_of(free, random_draws(free, DRAWS))


def test_values_of_three_wavelengths_lie_on_a_line():
    """And are level beyond: what a metal given for R, G and B is taken for elsewhere."""
    table = along_the_spectrum(np.array([2.9, 2.8, 2.6]), (645.0, 525.0, 445.0))
    found = np.asarray(table.index(np.array([380.0, 445.0, 485.0, 645.0, 730.0])))
    np.testing.assert_allclose(found, [2.6, 2.6, 2.7, 2.9, 2.9])
    assert along_the_spectrum(2.0, (645.0, 525.0)) == 2.0


def test_values_leave_out_what_is_there():
    plans = {method.name: method.apply(PAINT, 1e-3) for method in BRDF_METHODS if method.name != "planned"}
    missing = {name for name, plan in plans.items() if isinstance(plan, str)}
    assert missing == {
        *("8 angles", "16 angles", "32 angles", "normal incidence", "s alone", "transparent film"),
        *("parallel boundaries", "mean wavelengths", "no lobe of the coat", "single scattering"),
    }
    assert not plans["without interference"].on("coherence")


def test_record_and_report_say_the_same():
    one, other = (
        Result(name, "x", error, seconds, 1.0, {"flops": flops})
        for name, error, seconds, flops in (("nodes-6-500", 0.2, 1e-7, 900.0), ("float64", 0.0, 9e-8, None))
    )
    seen = Comparison("colour", "steps of 1 nm", 0.5, "ΔE2000", 40, 64, results=[one])
    values = Comparison("brdf", "float64", 1e-3, "relative", 40, 64, results=[other])
    record = to_json(Cost(colours=seen, values=values), "steel.toml")
    assert record["schema"] == "pellicle.cost/1"
    assert (record["unit"], record["recommended"]) == ("ΔE2000", "nodes-6-500")
    assert [method["kind"] for method in record["rungs"]] == ["colour", "brdf"]
    assert record["brdf"]["recommended"] == "float64"
    report = text(Cost(colours=seen, values=values), "steel.toml")
    assert "nodes-6-500 is the fastest within an error of 0.5 in ΔE2000" in report
    assert "float64 is the fastest within a relative error of 0.001" in report
    assert "100" in report  # ns
    alone = to_json(Cost(values=values, no_colours="no film"), "paint.toml")
    assert (alone["unit"], alone["no_colours"]) == ("relative", "no film")
