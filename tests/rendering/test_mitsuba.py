"""Films exported to Mitsuba, rendered by it, against Airy's formula, and Walter's facets written out here."""

import importlib.util
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
from pellicle.colour import delta_e2000, lab, sensor
from pellicle.errors import UsageError
from pellicle.rendering import mitsuba_plugin
from pellicle.rendering.appearance import appearance
from pellicle.rendering.mitsuba import ALPHA, lookup, write_surface
from tests.airy import airy
from tests.directions import unit

mi = pytest.importorskip("mitsuba")
tmm = pytest.importorskip("tmm")

THICKNESS, LAYER, BASE = 43.0, 2.9, 2.7 + 2.8j
STEEL = pl.Scene(pl.Layer(LAYER, THICKNESS), BASE)
# linear sRGB of IEC 61966-2-1 to XYZ
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
LIGHTS = [(5, 5, 0), (20, 24, 3), (35, 30, 0), (50, 50, 10), (60, 63, 0), (70, 70, 4), (75, 72, 0)]
"""Angles of light and viewer in degrees, and by how much the viewer is off the plane of incidence."""


def xyz(spectrum, wavelength):
    """XYZ under D65 of a reflectance, by steps of 1 nm."""
    eye = sensor()
    return np.interp(eye.wavelength, wavelength, spectrum) @ eye.weights


def lobe(i, o, alpha):
    """D G₁G₁/(4 cos θ_i) of GGX facets (Walter et al. 2007, eqs. 33, 34): the BRDF times cos θ_o."""
    h = (i + o) / np.linalg.norm(i + o)
    d = alpha**2 / (np.pi * (h[2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    masks = [2 / (1 + np.sqrt(1 + alpha**2 * (1 / c**2 - 1))) for c in (i[2], o[2])]
    # height-correlated, as in pellicle; Mitsuba's own facets are not
    together = masks[0] * masks[1] / (masks[0] + masks[1] - masks[0] * masks[1])
    return d / (4 * i[2]) * np.array([together, masks[0] * masks[1]]), h @ i


def directions():
    for light, viewer, off in LIGHTS:
        yield [unit(light, 0), unit(viewer, 180 + off)]


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    return pl.export(STEEL, to="mitsuba", path=tmp_path_factory.mktemp("mitsuba") / "steel.xml").files


def load_plugin(files):
    [path] = [file for file in files if file.name == "pellicle_film.py"]
    spec = importlib.util.spec_from_file_location("pellicle_film", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.register()


def bsdfs(exported, measured):
    """Both ways to the film: the table of that number, and the plugin."""
    plugin = {"type": "pellicle_film", "filename": str(exported[2]), "alpha": ALPHA}
    return {"measured": {"type": "measured", "filename": str(exported[measured])}, "lookup": plugin}


def pixel(bsdf, light, viewer):
    """Render one pixel of a plane that parallel light of irradiance 1 hits."""
    from_above = mi.ScalarTransform4f().look_at((9 * viewer).tolist(), [0, 0, 0], [0, 1, 0])
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sun": {
                "type": "directional",
                "direction": (-light).tolist(),
                "irradiance": {"type": "rgb", "value": 1.0},
            },
            "plane": {"type": "rectangle", "material": bsdf},
            "sensor": {
                "type": "orthographic",
                "to_world": from_above @ mi.ScalarTransform4f().scale(0.01),
                "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}},
                "sampler": {"type": "independent", "sample_count": 1},
            },
        }
    )
    return np.asarray(mi.render(scene), float).reshape(-1)[:3]


@pytest.mark.slow  # renders for 5 s each
@pytest.mark.parametrize("kind", ["measured", "lookup"])
def test_rendered_colours_are_the_exact_ones(exported, kind):
    mi.set_variant("scalar_rgb")
    load_plugin(exported)
    bsdf = bsdfs(exported, 0)[kind]
    found, exact = [], []
    for light, viewer in directions():
        lobes, cosine = lobe(viewer, light, ALPHA)
        rgb = pixel(bsdf, light, viewer) / lobes[0 if kind == "measured" else 1]
        found.append(TO_XYZ @ rgb)
        eye = sensor()
        colour = xyz(airy(eye.wavelength, THICKNESS, LAYER, BASE, cosine), eye.wavelength)
        exact.append(TO_XYZ @ np.maximum(np.linalg.solve(TO_XYZ, colour), 0))  # within sRGB
    white = sensor().white
    assert np.max(delta_e2000(lab(np.array(found), white), lab(np.array(exact), white))) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["measured", "lookup"])
def test_rendered_spectra_are_the_exact_ones(exported, kind):
    mi.set_variant("scalar_spectral")
    load_plugin(exported)
    bsdf = mi.load_dict(bsdfs(exported, 1)[kind])
    wavelength = np.arange(380.0, 731.0, 5.0)[:68].reshape(-1, 4)
    for light, viewer in directions():
        lobes, cosine = lobe(viewer, light, ALPHA)
        spectrum = []
        for four in wavelength.tolist():
            si = mi.SurfaceInteraction3f()
            si.wi, si.wavelengths = mi.Vector3f(*viewer.tolist()), four
            spectrum += np.ravel(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*light.tolist()))).tolist()
        spectrum = np.array(spectrum) / lobes[0 if kind == "measured" else 1]
        exact = airy(wavelength.ravel(), THICKNESS, LAYER, BASE, cosine)
        colours = [lab(xyz(each, wavelength.ravel()), sensor().white) for each in (spectrum, exact)]
        assert delta_e2000(*colours) < 0.5


@pytest.mark.slow  # tabulates and renders for 10 s
def test_a_mirror_has_the_reflectance_of_the_film_and_its_own_thickness(exported):
    mi.set_variant("scalar_rgb")
    load_plugin(exported)
    bare = {"type": "pellicle_film", "filename": str(exported[2]), "alpha": 0.0, "thickness": 0.0}
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(0, 0.6, 0.8)
    sampled, weight = mi.load_dict(bare).sample(mi.BSDFContext(), si, 0.5, [0.5, 0.5])
    np.testing.assert_allclose(np.ravel(sampled.wo), [0, -0.6, 0.8], atol=1e-6)
    eye = sensor()
    expected = np.linalg.solve(TO_XYZ, xyz(airy(eye.wavelength, 0.0, LAYER, BASE, 0.8), eye.wavelength))
    # bilinear in the cosine, and the coefficients of sRGB have four digits
    np.testing.assert_allclose(np.ravel(weight), expected, rtol=1e-3)


@pytest.mark.slow
def test_scenes_load_and_show_the_film(exported):
    mi.set_variant("scalar_rgb")
    load_plugin(exported)
    scenes = [mi.load_file(str(file), size="9", spp="64") for file in exported[4:6]]
    images = [np.asarray(mi.render(scene), float)[4, 4] for scene in scenes]
    assert json.loads(exported[-1].read_text("utf-8"))["target"] == "mitsuba"
    # blue oxide in the middle of the sphere, the same by both ways but for noise and masking
    assert images[0][2] > 1.5 * images[0][0]
    np.testing.assert_allclose(images[0], images[1], rtol=0.2)


@pytest.mark.slow
def test_an_uneven_film_takes_its_thickness_from_an_image(tmp_path):
    nm = np.linspace(10.0, 60.0, 8)[None, :] + np.zeros((4, 1))
    made = pl.export(STEEL, to="mitsuba", path=tmp_path / "uneven.xml", thickness_map=nm)
    assert [file.suffix for file in made.files] == [".npz", ".png", ".py", ".xml", ".json"]
    mi.set_variant("scalar_rgb")
    load_plugin(made.files)
    scene = mi.load_file(str(made.files[3]))
    assert "ball.bsdf.thickness.data" in mi.traverse(scene)  # as the documentation has it
    [bsdf] = [shape.bsdf() for shape in scene.shapes() if "pellicle_film" in str(shape.bsdf())]
    si = mi.SurfaceInteraction3f()
    si.wi, si.uv = mi.Vector3f(0, 0, 1), mi.Point2f(0.5 + 0.5 / 8, 0.5)  # the middle of the fifth column
    value = np.ravel(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1)))
    eye = sensor()
    colour = np.linalg.solve(TO_XYZ, xyz(airy(eye.wavelength, nm[0, 4], LAYER, BASE), eye.wavelength))
    # 16 bits of 50 nm, and the table's own error
    np.testing.assert_allclose(value / lobe(*np.array([[0, 0, 1.0]] * 2), ALPHA)[0][1], colour, atol=1e-3)
    with pytest.raises(
        UsageError, match=r"a \.bsdf has one thickness and one roughness; export a map of them"
    ):
        pl.export(STEEL, to="mitsuba", path=tmp_path / "uneven.bsdf", thickness_map=nm)


FILMS = {
    "metal": pl.Scene(pl.Layer(2.7 + 2.8j, 5.0), 2.7 + 2.8j),
    "glass": pl.Scene(pl.Layer(1.5, 5.0), 1.5),
    "film": pl.Scene(pl.Layer(2.0, 150.0), 1.5),
    "steel": STEEL,
}
"""Two bare faces, and two films."""


@pytest.fixture(scope="module")
def tabulated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lookups")
    for name, scene in FILMS.items():
        np.savez(folder / f"{name}.npz", **lookup(appearance(scene)).arrays())

    def bsdf(name, alpha, variant):
        mi.set_variant(variant)
        mitsuba_plugin.register()
        return mi.load_dict(
            {"type": "pellicle_film", "filename": str(folder / f"{name}.npz"), "alpha": alpha}
        )

    return bsdf


def interaction(wi, nm=550.0):
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(*np.ravel(wi).tolist())
    if mi.is_spectral:
        si.wavelengths = [nm] * 4
    return si


def sphere_directions(count, below):
    """Pairs of directions, half of them near each other's mirror image, on both sides if `below`."""
    random = np.random.default_rng(0)
    wi, wo = random.normal(size=(2, count, 3))
    wo[::2] = wi[::2] * [-1, -1, 1] + 0.2 * random.normal(size=(len(wo[::2]), 3))
    for vectors in (wi, wo):
        vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
        if not below:
            vectors[:, 2] = np.abs(vectors[:, 2])
    return zip(wi, wo, strict=True)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["Radiance", "Importance"])
@pytest.mark.parametrize(("name", "own"), [("metal", "roughconductor"), ("glass", "roughdielectric")])
def test_bare_faces_are_those_of_mitsuba(tabulated, name, own, mode):
    film, context = tabulated(name, 0.2, "scalar_rgb"), mi.BSDFContext(getattr(mi.TransportMode, mode))
    numbers = {"eta": 2.7, "k": 2.8} if name == "metal" else {"int_ior": 1.5, "ext_ior": 1.0}
    built_in = mi.load_dict({"type": own, "distribution": "ggx", "alpha": 0.2} | numbers)
    each = [
        [(np.ravel(x.eval(context, at, to)), x.pdf(context, at, to)) for x in (film, built_in)]
        for at, to in (
            (interaction(wi), mi.Vector3f(*wo.tolist())) for wi, wo in sphere_directions(300, name == "glass")
        )
    ]
    values = np.array([[value for value, _ in pair] for pair in each])
    pdfs = np.array([[pdf for _, pdf in pair] for pair in each])
    assert np.max(np.abs(values[:, 0] - values[:, 1])) < 1e-3 * np.max(values)
    assert np.max(np.abs(pdfs[:, 0] - pdfs[:, 1])) < 1e-3 * np.max(pdfs)


@pytest.mark.slow
def test_rough_metal_turns_polarisation_as_that_of_mitsuba_does(tabulated):
    film, context = tabulated("metal", 0.2, "scalar_spectral_polarized"), mi.BSDFContext()
    spectra = {key: {"type": "spectrum", "value": x} for key, x in (("eta", 2.7), ("k", 2.8))}
    built_in = mi.load_dict({"type": "roughconductor", "distribution": "ggx", "alpha": 0.2} | spectra)
    for wi, wo in sphere_directions(50, below=False):
        at, to = interaction(wi), mi.Vector3f(*wo.tolist())
        found, own = (np.array(x.eval(context, at, to))[..., 0] for x in (film, built_in))
        np.testing.assert_allclose(found, own, atol=1e-3 * max(np.max(np.abs(own)), 1.0))


def amplitudes(nm, degrees, indices, thickness, transmitted):
    """Mueller elements m11, m12, m33, m34 of tmm's waves, in Mitsuba's order of s and p, and its time."""
    waves = [
        tmm.coh_tmm(each, indices, [np.inf, thickness, np.inf], np.deg2rad(degrees), nm) for each in "sp"
    ]
    powers = [max(wave["T" if transmitted else "R"], 0.0) for wave in waves]
    s, p = (
        np.sqrt(power) * np.exp(1j * np.angle(wave["t" if transmitted else "r"]))
        for wave, power in zip(waves, powers, strict=True)
    )
    # tmm's p field points the other way on reflection
    both = s * np.conj(p)
    return 0.5 * (powers[0] + powers[1]), 0.5 * (powers[0] - powers[1]), both.real, -both.imag


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [25.0, 55.0, 70.0, 130.0, 155.0])
@pytest.mark.parametrize("transmitted", [False, True])
def test_polarised_light_is_that_of_the_waves(tabulated, degrees, transmitted):
    film = tabulated("film", 0.0, "scalar_spectral_polarized")
    below = degrees > 90
    within = min(degrees, 180 - degrees)
    if transmitted and below and 1.5 * np.sin(np.deg2rad(within)) > 1:
        pytest.skip("all light is reflected")
    wi = unit(degrees, 0)
    for nm in (431.0, 552.5, 688.0):
        at = interaction(wi, nm)
        sampled, weight = film.sample(mi.BSDFContext(), at, 1 - 1e-6 if transmitted else 0.0, [0.5, 0.5])
        matrix = np.array(weight)[..., 0] * sampled.pdf * (sampled.eta**2 if transmitted else 1.0)
        indices = [1.5, 2.0, 1.0] if below else [1.0, 2.0, 1.5]
        a, b, c, s = amplitudes(nm, within, indices, 150.0, transmitted)
        rows = [[a, b, 0, 0], [b, a, 0, 0], [0, 0, c, s], [0, 0, -s, c]]
        expected = mi.Spectrum([[mi.UnpolarizedSpectrum(float(x)) for x in row] for row in rows])
        seen, source = mi.Vector3f(*wi.tolist()), sampled.wo
        axis = mi.Vector3f(0, 1 if np.ravel(wi)[0] * np.ravel(wi)[2] > 0 else -1, 0)
        basis = mi.mueller.stokes_basis
        expected = mi.mueller.rotate_mueller_basis(
            expected, -source, axis, basis(-source), seen, axis, basis(seen)
        )
        np.testing.assert_allclose(matrix, np.array(expected)[..., 0], atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [10.0, 50.0, 75.0, 105.0, 140.0, 170.0])
def test_a_transparent_film_passes_what_it_does_not_reflect(tabulated, degrees):
    film = tabulated("film", 0.0, "scalar_spectral")
    context = mi.BSDFContext(mi.TransportMode.Importance)
    total = 0.0
    for sample in (0.0, 1 - 1e-6):
        sampled, weight = film.sample(context, interaction(unit(degrees, 0)), sample, [0.5, 0.5])
        total += 0.0 if sample and sampled.wo.z * np.cos(np.deg2rad(degrees)) > 0 else weight[0] * sampled.pdf
    np.testing.assert_allclose(total, 1.0, atol=1e-3)


def spread_directions(count):
    """Pairs of directions over the hemisphere, at most 75° from the normal."""
    random = np.random.default_rng(0)
    for light, viewer in random.uniform(size=(count, 2, 2)):
        thetas = np.arccos(1 - (1 - np.cos(np.deg2rad(75))) * np.array([light[0], viewer[0]]))
        yield list(unit(np.rad2deg(thetas), 360 * np.array([light[1], viewer[1]])))


EXPONENTS = {"exponent_reflection": 12.0, "exponent_transmission": 20.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("surface", "median"),
    [
        (pl.Surface("microfacet-film", {"thickness": 40.0, "roughness": 0.4, "diffuse": 0.05}), 0.003),
        # azimuths of the table are 11° apart
        pytest.param(
            *(pl.Surface("granier-heidrich", {"thickness": 300.0, "deviation": 8.0} | EXPONENTS), 0.03),
            marks=pytest.mark.slow,
        ),
    ],
    ids=lambda value: getattr(value, "model", ""),
)
def test_whole_surfaces_are_what_mitsuba_evaluates(tmp_path, surface, median):
    write_surface(tmp_path / "surface.bsdf", surface)
    mi.set_variant("scalar_rgb")
    bsdf = mi.load_dict({"type": "measured", "filename": str(tmp_path / "surface.bsdf")})
    pairs, found = list(spread_directions(300)), []
    for light, viewer in pairs:
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(*light.tolist())
        value = np.ravel(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*viewer.tolist())))
        found.append(value / viewer[2])
    i, o = (jnp.asarray(each) for each in np.swapaxes(pairs, 0, 1))
    numbers = {key: np.asarray(x) for key, x in surface.start_numbers().items()}
    exact = np.asarray(jax.jit(lambda *args: surface.brdf(*args))(numbers, i, o))
    assert np.median(np.abs(found - exact) / exact.max(axis=1, keepdims=True)) < median


def test_a_table_of_another_version_is_refused(tmp_path):
    np.savez(tmp_path / "old.npz", rgb=np.ones((2, 2, 3)), thickness=[0.0, 1.0])
    mi.set_variant("scalar_rgb")
    mitsuba_plugin.register()
    with pytest.raises(
        RuntimeError, match=r"old\.npz: is of another version of pellicle; export the film again"
    ):
        mi.load_dict({"type": "pellicle_film", "filename": str(tmp_path / "old.npz")})


@pytest.mark.slow
def test_a_film_of_less_index_than_its_base_has_numbers_everywhere():
    """At grazing incidence from below no light reaches it: NaN there would spread to light from above."""
    arrays = lookup(appearance(pl.Scene(pl.Layer(1.5, 1000.0), 1.7))).arrays()
    assert [key for key, values in arrays.items() if not np.all(np.isfinite(values))] == []


def test_surfaces_without_colour_are_refused(tmp_path):
    with pytest.raises(UsageError, match="has R, G and B: the surface has 1 wavelengths"):
        write_surface(tmp_path / "x.bsdf", pl.Surface("microfacet-film", wavelengths=(550.0,)))


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "steel.bsdf").touch()
    with pytest.raises(UsageError, match=r"steel\.bsdf: exists and is not overwritten"):
        pl.export(STEEL, to="mitsuba", path=tmp_path / "steel.xml")
    assert [file.name for file in tmp_path.iterdir()] == ["steel.bsdf"]
