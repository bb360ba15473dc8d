"""Mixtures, sums of oscillators and splines as recipes write them, and words of every model."""

import jax
import numpy as np
import pytest

from pellicle.dispersion.effective_medium import Bruggeman, Looyenga, MaxwellGarnett
from pellicle.dispersion.oscillators import Gaussian, Lorentz, Oscillators, TaucLorentz
from pellicle.errors import DataError, UsageError
from pellicle.fitting.film.parameters import fixed_numbers, parameters
from pellicle.recipes import media
from pellicle.recipes.dispersion_models import KNOTS, MODELS, TERMS
from pellicle.scene.film import Scene
from pellicle.scene.free import is_free
from pellicle.scene.graded import Graded
from pellicle.scene.layers import Layer

AT = np.array([450.0, 633.0, 850.0])


def names(scene):
    return {p.name: p for p in parameters(scene)}


def test_a_porous_layer(scene_of):
    media = 'mix = "bruggeman", host = "SiO2", inclusion = "air"'
    scene = scene_of(f"{{ {media}, fraction = {{ lower = 0, upper = 0.5 }} }}")
    assert isinstance(scene.layers[0].material, Bruggeman)
    (fraction,) = parameters(scene)
    assert (fraction.name, fraction.unit, fraction.lower, fraction.upper) == ("fraction", "", 0, 0.5)
    assert fraction.natural[0]
    assert fraction.searched


def test_a_list_of_two_is_host_and_inclusion(scene_of):
    listed = scene_of('{ mix = "maxwell-garnett", materials = ["SiO2", "Au"], fraction = 0.1 }')
    named = scene_of('{ mix = "maxwell-garnett", host = "SiO2", inclusion = "Au", fraction = 0.1 }')
    assert isinstance(listed.layers[0].material, MaxwellGarnett)
    np.testing.assert_array_equal(listed.layers[0].material(AT), named.layers[0].material(AT))


def test_mixtures_of_models_and_of_mixtures(scene_of):
    scene = scene_of(
        '{ mix = "looyenga", fraction = 0.2, inclusion = 1.0,'
        ' host = { mix = "linear", host = { model = "cauchy", A = { lower = 1.3, upper = 1.7 } },'
        ' inclusion = { model = "tauc-lorentz", Eg = { lower = 1.0, upper = 3.0 } }, fraction = 0.4 } }'
    )
    assert isinstance(scene.layers[0].material, Looyenga)
    assert set(names(scene)) == {"host.host.A", "host.inclusion.Eg"}
    assert names(scene)["host.inclusion.Eg"].unit == "eV"
    fixed = {name: (value, unit) for name, value, unit in fixed_numbers(scene)}
    assert fixed["fraction"] == (0.2, "")
    assert fixed["host.fraction"] == (0.4, "")
    assert fixed["host.inclusion.A"] == (100.0, "eV")
    assert fixed["host.host.C"] == (0.0, "nm^4")


def test_a_sum_of_oscillators(scene_of):
    scene = scene_of(
        '{ model = "oscillators", eps_inf = { lower = 1, upper = 4 }, terms = ['
        '{ kind = "lorentz", A = { lower = 0, upper = 3 }, E0 = 3.0, gamma = 0.4 },'
        '{ kind = "gaussian", E0 = { lower = 3, upper = 5 } } ] }'
    )
    material = scene.layers[0].material
    assert isinstance(material, Oscillators)
    assert [type(t) for t in material.terms] == [Lorentz, Gaussian]
    found = names(scene)
    assert set(found) == {"eps_inf", "term1.A", "term2.E0"}
    assert found["term1.A"].natural[0]
    assert (found["term1.A"].unit, found["term2.E0"].unit) == ("", "eV")


def test_splines(scene_of):
    spline = '{ model = "spline", knots = [400, 600, 900], '
    scene = scene_of(spline + "n = { lower = 1.2, upper = 2.5 }, k = [0.1, 0, 0] }")
    assert set(names(scene)) == {"n1", "n2", "n3"}
    assert scene.layers[0].material.knots == (400, 600, 900)
    scene = scene_of('{ model = "spline-kk", knots = [400, 600, 900], k = { lower = 0, upper = 1 } }')
    assert set(names(scene)) == {"k1", "k2", "k3"}
    assert all(p.natural[0] for p in parameters(scene))


@pytest.mark.parametrize(
    ("material", "said"),
    [
        ('{ mix = "bruggemann", host = "SiO2", inclusion = "air", fraction = 0.1 }', "'bruggeman'"),
        ('{ mix = "bruggeman", host = "SiO2", inclusion = "air", fraction = 1.2 }', "0 to 1, got 1.2"),
        ('{ mix = "linear", host = 1, inclusion = 1, fraction = { lower = -0.2, upper = 1 } }', "got -0.2"),
        ('{ mix = "linear", host = "SiO2", inclusion = "air" }', "fraction missing"),
        ('{ mix = "linear", host = "SiO2", guest = "air", fraction = 0.1 }', "has no 'guest'"),
        ('{ mix = "linear", materials = ["SiO2"], fraction = 0.1 }', "a list of two"),
        ('{ mix = "linear", host = [1], inclusion = "air", fraction = 0.1 }', "host must be"),
        ('{ model = "lorentz", A = -1.0 }', "A must not be negative, got -1"),
        ('{ model = "tauc-lorentz", Eg = 5.0, E0 = 4.0 }', "Eg must lie below the resonance E0"),
        ('{ model = "tauk-lorentz" }', "did you mean 'tauc-lorentz'"),
        ('{ model = "oscillators" }', "needs terms"),
        ('{ model = "oscillators", terms = [{ A = 1.0 }] }', "needs a kind"),
        ('{ model = "oscillators", terms = [{ kind = "lorenz" }] }', "did you mean 'lorentz'"),
        ('{ model = "oscillators", eps = 1, terms = [{ kind = "drude" }] }', "no parameter 'eps'"),
        ('{ model = "spline", knots = [600, 400], n = 1.5 }', "rising"),
        ('{ model = "spline", knots = [400, 600], n = [1.5, 1.4, 1.3] }', "one number a knot, 2, got 3"),
        ('{ model = "spline", knots = [400, 600], k = { lower = -1, upper = 1 } }', "must not be negative"),
        ('{ model = "spline", knots = "many" }', "knots must be"),
    ],
)
def test_refused_in_one_sentence(scene_of, material, said):
    with pytest.raises(DataError) as error:
        scene_of(material)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_every_bare_model_is_a_scene_whose_index_is_finite_over_its_bounds(name):
    """At both ends of every default bound and at the start; Sellmeier's pole is at 245 nm at most."""
    scene = Scene(Layer(media.medium(name), 100.0), "Si")
    free = parameters(scene)
    assert len({p.name for p in free}) == len(free) > 0
    for choose in ("lower", "start", "upper"):
        values = iter([getattr(p, choose) for p in free])
        material = _filled(scene.layers[0].material, values)
        index = np.asarray(material(np.linspace(260.0, 2500.0, 41)))
        assert np.all(np.isfinite(index))
        assert np.all(index.imag >= 0)


def _filled(tree, values):
    return jax.tree.map(lambda x: next(values) if is_free(x) else x, tree, is_leaf=is_free)


def test_calls_fix_in_the_order_of_the_table(refuses):
    layer = media.medium("tauc-lorentz(120,4.1,2.3,2.2,1.5)")
    assert layer == Oscillators(1.5, (TaucLorentz(120.0, 4.1, 2.3, 2.2),))
    bk7 = media.medium("sellmeier(1.03961212,6000.69867,0.231792344,20017.9144,1.01046945,103560653)")
    assert float(bk7.index(587.5618)) == pytest.approx(1.5168, abs=5e-7)
    assert media.medium("spline(400,500,700)").knots == (400, 500, 700)
    assert media.medium("spline").knots == KNOTS
    refuses(UsageError, "Eg must lie below", media.medium, "tauc-lorentz(120,2,2.3,4)")
    refuses(UsageError, "did you mean 'tauc-lorentz'", media.medium, "tauc-lorenz")


def test_any_parameter_of_a_model_can_be_freed(refuses):
    layer = media.medium("tauc-lorentz(120,4.1,2.3,2.2,1.5)", ["Eg", "E0=3.5:5", "k"])
    free = names(Scene(Layer(layer, 100.0), "Si"))
    assert set(free) == {"Eg", "E0", "k"}
    usual = TERMS["tauc-lorentz"]["Eg"]
    assert (free["Eg"].start, free["Eg"].lower, free["Eg"].upper) == (2.2, usual.lower, usual.upper)
    assert (free["E0"].lower, free["E0"].upper) == (3.5, 5)
    assert media.medium("sellmeier(1.1,8000)", ["B1"]).B[0].lower == 0.1
    refuses(UsageError, "A must not be negative", media.medium, "lorentz(1,3,0.5)", ["A=-1:1"])
    refuses(UsageError, r"the layer has .*gamma", media.medium, "lorentz(1,3,0.5)", ["gama"])


def test_numbers_of_two_layers_do_not_collide():
    layers = [Layer(media.medium("lorentz"), 10.0, "top"), Layer(media.medium("lorentz"), 10.0)]
    found = [p.name for p in parameters(Scene(layers, "Si"))]
    assert len(set(found)) == len(found) == 8
    assert {"top.A", "layer2.A"} <= set(found)


def test_a_graded_layer(scene_of):
    scene = scene_of(
        '{ graded = ["SiO2", { model = "cauchy", A = { lower = 1.8, upper = 2.1 } }], mix = "linear",'
        ' profile = "exponential", top = { lower = 0, upper = 1 }, bottom = 0.2, length = 0.3 }'
    )
    material = scene.layers[0].material
    assert isinstance(material, Graded)
    assert (type(material.profile).__name__, material.mix) == ("Exponential", "linear")
    assert list(names(scene)) == ["second.A", "top"]
    assert names(scene)["top"].searched


def test_a_free_profile(scene_of):
    graded = '{ graded = ["SiO2", "Si3N4"], profile = "spline", values = [0, { lower = 0, upper = 1 }, 1] }'
    (value,) = parameters(scene_of(graded))
    assert (value.name, value.group, value.natural) == ("values2", "values", (True, False))


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ('{ graded = ["SiO2", "Si3N4"], topp = 0.1 }', "linear profile has no 'topp' .did you mean 'top'"),
        ('{ graded = ["SiO2", "Si3N4"], profile = "expnential" }', "did you mean 'exponential'"),
        ('{ graded = ["SiO2", "Si3N4"], mix = "brugeman" }', "did you mean 'bruggeman'"),
        ('{ graded = ["SiO2", "Si3N4"], top = 1.5 }', "top is a volume fraction, 0 to 1, got 1.5"),
        ('{ graded = ["SiO2", "Si3N4"], profile = "spline" }', "needs values"),
        ('{ graded = ["SiO2"] }', r"material\.graded must be two media, as in .*, got \['SiO2'\]"),
        ("{ model = 3 }", r"material\.model must be a text, got 3"),
    ],
)
def test_graded_layers_that_are_refused(scene_of, material, message, refuses):
    refuses(DataError, message, scene_of, material)
