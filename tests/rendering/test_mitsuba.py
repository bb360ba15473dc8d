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
from pellicle.rendering.mitsuba import ALPHA, write_surface
from tests.airy import airy
from tests.directions import unit

mi = pytest.importorskip("mitsuba")

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
    [bsdf] = [shape.bsdf() for shape in scene.shapes() if "pellicle_film" in str(shape.bsdf())]
    si = mi.SurfaceInteraction3f()
    si.wi, si.uv = mi.Vector3f(0, 0, 1), mi.Point2f(0.5 + 0.5 / 8, 0.5)  # the middle of the fifth column
    value = np.ravel(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1)))
    eye = sensor()
    colour = np.linalg.solve(TO_XYZ, xyz(airy(eye.wavelength, nm[0, 4], LAYER, BASE), eye.wavelength))
    # 16 bits of 50 nm, and the table's own error
    np.testing.assert_allclose(value / lobe(*np.array([[0, 0, 1.0]] * 2), ALPHA)[0][1], colour, atol=1e-3)
    with pytest.raises(UsageError, match=r"a \.bsdf has one thickness; export a map of thicknesses as \.xml"):
        pl.export(STEEL, to="mitsuba", path=tmp_path / "uneven.bsdf", thickness_map=nm)


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


def test_surfaces_without_colour_are_refused(tmp_path):
    with pytest.raises(UsageError, match="has R, G and B: the surface has 1 wavelengths"):
        write_surface(tmp_path / "x.bsdf", pl.Surface("microfacet-film", wavelengths=(550.0,)))


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "steel.bsdf").touch()
    with pytest.raises(UsageError, match=r"steel\.bsdf: exists and is not overwritten"):
        pl.export(STEEL, to="mitsuba", path=tmp_path / "steel.xml")
    assert [file.name for file in tmp_path.iterdir()] == ["steel.bsdf"]
