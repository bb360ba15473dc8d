"""`.bsdf` files: tensors, values of simple tables by hand, of any table by Mitsuba's own `measured`."""

import hashlib
import struct
from contextlib import suppress

import numpy as np
import pytest

import pellicle as pl
from pellicle.data.brdf_samples import vectors
from pellicle.data.formats.rgl import MAGIC, is_tensor_file, load_rgl, read_rgl, read_tensors, write_tensors
from pellicle.data.read_brdf import read_brdf_samples
from pellicle.data.read_spectrum import read_spectrum
from pellicle.data.rgl_tables import TableSize, tabulate
from pellicle.errors import DataError, UsageError

FIELDS = {
    "description": np.frombuffer(b"steel", np.uint8),
    "one": np.array([7], np.uint8),
    "grid": np.arange(24, dtype=np.float32).reshape(2, 3, 4) / 7,
    "double": np.array([[1e-300, np.pi]]),
    "counts": np.array([-5, 2**40], np.int64),
}


@pytest.fixture
def path(tmp_path):
    write_tensors(tmp_path / "made.bsdf", FIELDS)
    return tmp_path / "made.bsdf"


def test_what_is_written_is_read(path):
    assert is_tensor_file(path)
    read = read_tensors(path)
    assert list(read) == list(FIELDS)
    for name, field in FIELDS.items():
        assert read[name].dtype == field.dtype
        np.testing.assert_array_equal(read[name], field)


def test_bytes_of_a_file_as_the_format_states_them(tmp_path):
    """One field, byte by byte: header, version, count, name, axes, type 10 (float32), position, shape."""
    write_tensors(tmp_path / "x", {"ab": np.array([1.5, -2.0], np.float32)})
    head = MAGIC + bytes([1, 0, 1, 0, 0, 0, 2, 0]) + b"ab" + bytes([1, 0, 10])
    position = len(head) + 16
    padding = -position % 8
    expected = head + struct.pack("<QQ", position + padding, 2) + b"\0" * padding
    assert (tmp_path / "x").read_bytes() == expected + struct.pack("<2f", 1.5, -2.0)


def test_mitsuba_reads_it_and_writes_what_is_read(path, tmp_path, capsys):
    tensor_io = pytest.importorskip("mitsuba.python.tensor_io")
    theirs = tensor_io.read(str(path))
    tensor_io.write(str(tmp_path / "theirs.bsdf"), **FIELDS)
    ours = read_tensors(tmp_path / "theirs.bsdf")
    for name, field in FIELDS.items():
        np.testing.assert_array_equal(theirs[name], field)
        np.testing.assert_array_equal(ours[name], field)


def test_every_cut_and_every_wrong_byte_of_the_header(path, refuses):
    content = path.read_bytes()
    first = min(content.find(FIELDS["description"].tobytes()), 300)
    for end in range(len(MAGIC), len(content), 3):
        path.write_bytes(content[:end])
        refuses(DataError, f"^{path}: ", read_tensors, path)
    for at in range(len(MAGIC), first):
        path.write_bytes(content[:at] + bytes([content[at] ^ 0xFF]) + content[at + 1 :])
        with suppress(DataError):  # any other error fails
            read_tensors(path)


def test_other_versions_and_types_are_named(path, tmp_path, refuses):
    content = bytearray(path.read_bytes())
    content[12] = 2
    path.write_bytes(content)
    refuses(DataError, r"of version 2\.0, 1\.0 is expected", read_tensors, path)
    with pytest.raises(ValueError, match="`z`: tensor files have no numbers of type complex128"):
        write_tensors(tmp_path / "z", {"z": np.array([1j])})
    refuses(UsageError, "exists", write_tensors, path, FIELDS)


THETA = [0.05, 0.4, 0.9, 1.4]
WAVELENGTHS = np.linspace(400, 700, 5)


def fields(phi=(0.0,), spectral=False, jacobian=1, side=6):
    """A table of random numbers; that of an isotropic surface has its mirror symmetry.

    Mitsuba 3.9 does not initialise its `m_reduction` for isotropic files, so that it mirrors or turns the
    directions of some of them, by chance.
    """
    random = np.random.default_rng(0)
    shape, channels = (len(phi), len(THETA)), 5 if spectral else 3
    made = {
        "phi_i": np.array(phi),
        "theta_i": np.array(THETA),
        "ndf": random.uniform(0.5, 2, (4, 5)),
        "sigma": random.uniform(0.5, 2, (3, 6)),
        "vndf": random.uniform(0.2, 2, (*shape, 7, 9)),
        "luminance": random.uniform(0.2, 2, (*shape, side, side)),
        "spectra" if spectral else "rgb": random.uniform(0.1, 1, (*shape, channels, side, side)),
        **({"wavelengths": WAVELENGTHS} if spectral else {}),
    }
    if len(phi) == 1:
        made["sigma"][:] = made["sigma"][:1]
        for name in {"ndf", "vndf", "luminance", "rgb", "spectra"} & made.keys():
            made[name] = made[name] + np.flip(made[name], axis=-2)
    single = {name: array.astype(np.float32) for name, array in made.items()}
    text = np.frombuffer(b"random", np.uint8)
    return {"description": text, "jacobian": np.array([jacobian], np.uint8), **single}


def write(path, **kind):
    write_tensors(path, fields(**kind), overwrite=True)
    return path


def directions(count, seed=0):
    """Uniform over the hemisphere."""
    random = np.random.default_rng(seed)
    z, phi = random.uniform(0.02, 1, count), random.uniform(-np.pi, np.pi, count)
    return np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z])


def directions_of(samples):
    light = vectors(np.deg2rad(samples.theta_i), np.deg2rad(samples.phi_i))
    return light, vectors(np.deg2rad(samples.theta_o), np.deg2rad(samples.phi_o))


def measured(path, i, o, variant, wavelengths=None):
    """f cos θ_o by Mitsuba's `measured`, one pair of directions at a time."""
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant(variant)
    bsdf = mitsuba.load_dict({"type": "measured", "filename": str(path)})
    found = []
    for light, viewer in zip(i.T.tolist(), o.T.tolist(), strict=True):
        at = mitsuba.SurfaceInteraction3f()
        at.wi = mitsuba.Vector3f(*light)
        if wavelengths is not None:
            at.wavelengths = wavelengths
        found.append(np.array(bsdf.eval(mitsuba.BSDFContext(), at, mitsuba.Vector3f(*viewer))))
    return np.array(found)


@pytest.mark.parametrize("jacobian", [0, 1])
@pytest.mark.parametrize(
    "phi",
    [(0.0,), np.linspace(-np.pi, np.pi, 5), np.linspace(-np.pi, 0, 4), np.linspace(-np.pi, -np.pi / 2, 3)],
    ids=["isotropic", "anisotropic", "half", "quarter"],
)
def test_values_are_those_of_mitsuba(tmp_path, phi, jacobian):
    path = write(tmp_path / "made.bsdf", phi=phi, jacobian=jacobian)
    i, o = directions(150), directions(150, 1)
    theirs = measured(path, i, o, "scalar_rgb")
    # Mitsuba computes in float32
    np.testing.assert_allclose(load_rgl(path).evaluate(i, o) * o[2][:, None], theirs, rtol=3e-5, atol=1e-6)


def test_spectra_are_those_of_mitsuba(tmp_path):
    path = write(tmp_path / "made.bsdf", spectral=True)
    i, o = directions(60), directions(60, 1)
    at = [450.0, 525.0, 612.0, 690.0]
    theirs = measured(path, i, o, "scalar_spectral", at)
    stored = load_rgl(path).evaluate(i, o) * o[2][:, None]
    ours = [np.interp(at, WAVELENGTHS, row) for row in stored]
    np.testing.assert_allclose(ours, theirs, rtol=3e-5, atol=1e-6)


def test_a_uniform_density_leaves_the_grid_over_half_vectors(tmp_path):
    """Without a warp the table is bilinear in √(2θ_m/π) and (φ_m − φ_i + π)/2π: values written as such."""
    made = fields(jacobian=0, side=9)
    made["vndf"][:] = 1
    y, x = np.mgrid[:9, :9] / np.float32(8)
    made["rgb"][:] = np.stack([1 + x, 2 + y, 3 + x * y])
    path = tmp_path / "made.bsdf"
    write_tensors(path, made)
    i, o = directions(100), directions(100, 1)
    half = i + o
    u = np.sqrt(np.arccos(half[2] / np.linalg.norm(half, axis=0)) * 2 / np.pi)
    turn = np.arctan2(half[1], half[0]) - np.arctan2(i[1], i[0])
    v = (turn + np.pi) / (2 * np.pi) % 1
    found = load_rgl(path).evaluate(i, o) * o[2][:, None]
    np.testing.assert_allclose(found, np.stack([1 + u, 2 + v, 3 + u * v], 1), rtol=1e-6)
    below = load_rgl(path).evaluate(i, o * [[1], [1], [-1]])
    assert (below == 0).all()


@pytest.mark.parametrize("phi", [(0.0,), np.linspace(-3, 3, 5)], ids=["isotropic", "anisotropic"])
def test_samples_are_the_stored_values_at_their_directions(tmp_path, phi):
    path = write(tmp_path / "made.bsdf", phi=phi)
    samples = read_brdf_samples(path, samples=40)
    assert len(samples) == 40
    assert 'give the surface sensor = "srgb"' in samples.notes[0]
    light, viewer = directions_of(samples)
    np.testing.assert_allclose(load_rgl(path).evaluate(light, viewer), samples.values, rtol=1e-5)
    # each is a stored number: divided by what depends on direction alone, ratios of channels are those stored
    stored = np.asarray(fields(phi=phi)["rgb"], float)[..., 1:-1, 1:-1]
    ratios = (stored[:, :, 1] / stored[:, :, 0]).ravel()
    found = samples.values[:, 1] / samples.values[:, 0]
    assert np.abs(ratios - found[:, None]).min(axis=1).max() < 1e-12
    assert samples.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (samples.phi_i == 0).all() == (len(phi) == 1)


def test_what_is_left_out_is_counted(tmp_path):
    made = fields()
    made["rgb"][0, 1, 1, 2, 3] = -0.5
    made["rgb"][0, 2, 0, 2, 3] = np.nan
    write_tensors(tmp_path / "made.bsdf", made)
    every, near = (read_brdf_samples(tmp_path / "made.bsdf", max_theta=t) for t in (None, 60))
    inside = len(THETA) * 4 * 4
    left_out = [int(word) for word in every.notes[2].split() if word.isdigit()]
    assert left_out[1] == 2
    assert len(every) + sum(left_out) == inside
    assert 0 < len(near) < len(every)
    assert max(near.theta_i.max(), near.theta_o.max()) <= 60
    assert "nodes with a direction more than 60 degrees from the normal" in near.notes[2]


def test_spectra_are_taken_at_wavelengths(tmp_path):
    path = write(tmp_path / "made.bsdf", spectral=True)
    red, all_three = (read_brdf_samples(path, wavelengths=w) for w in ([500.0], [625.0, 500.0, 437.5]))
    assert red.channels == ("value",)
    np.testing.assert_allclose(red.values[:, 0], all_three.values[:, 1], rtol=1e-14)
    light, viewer = directions_of(all_three)
    rows = load_rgl(path).evaluate(light, viewer)
    expected = [np.interp([625.0, 500.0, 437.5], WAVELENGTHS, row) for row in rows]
    np.testing.assert_allclose(all_three.values, expected, rtol=1e-5)
    with pytest.raises(DataError, match=r"go from 400 to 700 nm; .* `wavelengths` there, not 900"):
        read_brdf_samples(path, wavelengths=[900.0])


def test_spectra_are_integrated_over_bands(tmp_path):
    """By the trapezoidal rule over a triangular band, against the stored spectra at the same directions."""
    path = write(tmp_path / "made.bsdf", spectral=True)
    nm = np.linspace(450, 650, 401)
    weights = np.maximum(0, 1 - np.abs(nm[:, None] - [600.0, 550.0, 500.0]) / 50)
    read = read_brdf_samples(path, bands=(nm, weights))
    rows = load_rgl(path).evaluate(*directions_of(read))
    fine = np.array([np.interp(nm, WAVELENGTHS, row) for row in rows])
    np.testing.assert_allclose(read.values, fine @ weights, rtol=1e-5)
    assert "integrated over the bands" in read.notes[0]
    with pytest.raises(DataError, match="400 to 700 nm, beyond which the sensor sees more than 1 %"):
        read_brdf_samples(path, bands=(nm + 200, weights))


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ("wavelengths = [625, 500, 437.5]", {"wavelengths": [625.0, 500.0, 437.5]}),
        ('sensor = "camera.csv"', {"bands": True}),
    ],
)
def test_recipes_of_surfaces_read_their_own_channels(tmp_path, keys, expected):
    path = write(tmp_path / "made.bsdf", spectral=True)
    recipe = '[data]\nsignal = "brdf"\n[scene.surface]\nmodel = "microfacet-film"\n' + keys
    (tmp_path / "film.toml").write_text(recipe)
    nm = np.arange(430.0, 671.0, 10.0)
    bands = np.exp(-(((nm[:, None] - [600.0, 550.0, 500.0]) / 20) ** 2))
    rows = "\n".join(",".join(map(repr, row)) for row in np.column_stack([nm, bands]).tolist())
    (tmp_path / "camera.csv").write_text(f"wavelength_nm,R,G,B\n{rows}\n")
    described = pl.read_recipe(tmp_path / "film.toml")
    read = described.read(str(path))
    if expected.pop("bands", False):
        sensor = described.scene().sensor
        expected["bands"] = (np.asarray(sensor.wavelength), np.asarray(sensor.weights))
    np.testing.assert_array_equal(read.values, read_brdf_samples(path, **expected).values)


def without(name):
    return lambda made: made.pop(name)


def put(name, value):
    def change(made):
        made[name] = np.asarray(value(made[name]), np.float32)

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (without("vndf"), "vndf is expected; choose a .bsdf file"),
        (put("theta_i", lambda x: x[::-1]), "do not match in shape or order"),
        (put("rgb", lambda x: x[:, :2]), "do not match in shape or order"),
        (put("ndf", lambda x: -x), "ndf has values that are no densities"),
        (put("vndf", lambda x: 0 * x), "vndf is zero everywhere"),
        (put("vndf", lambda x: np.nan * x), "vndf has values that are no densities"),
        (put("rgb", lambda x: -x), "has no valid value of a BRDF; download it again"),
    ],
)
def test_tables_that_are_refused(tmp_path, change, said, refuses):
    made = fields()
    change(made)
    write_tensors(tmp_path / "made.bsdf", made)
    refuses(DataError, said, read_rgl, tmp_path / "made.bsdf")


def test_a_bsdf_is_no_spectrum(tmp_path):
    with pytest.raises(DataError, match="is a tensor file of a BRDF; fit it with a `recipe`"):
        read_spectrum(write(tmp_path / "made.bsdf"))


def facets(alpha, diffuse=0.0, across=0.0):
    """GGX microfacets of some colour and a diffuse part; `across` tilts them, without isotropy."""

    def brdf(i, o):
        h = (i + o) / np.linalg.norm(i + o, axis=0)
        cos_d = (i * h).sum(axis=0)
        x = h[0] - across * h[2]
        d = alpha**2 / np.pi / (h[2] ** 2 * alpha**2 + x**2 + h[1] ** 2) ** 2
        mask = [c * np.sqrt(alpha**2 + (1 - alpha**2) * c2 * c2) for c, c2 in ((o[2], i[2]), (i[2], o[2]))]
        colour = np.stack([0.5 + 0.5 * (1 - cos_d) ** 5, 0.2 + 0.1 * np.cos(6 * cos_d), 0.4 * cos_d], 1)
        return (d * 0.5 / (mask[0] + mask[1]))[:, None] * colour + diffuse

    return brdf


def lobe(alpha, count, seed=0):
    """Pairs of directions drawn from the lobe, at most 75° from the normal."""
    random = np.random.default_rng(seed)
    i = vectors(np.arccos(random.uniform(np.cos(1.3), 1, count)), random.uniform(0, 2 * np.pi, count))
    u = random.uniform(0, 1, count)
    m = vectors(np.arctan(alpha * np.sqrt(u / (1 - u))), random.uniform(0, 2 * np.pi, count))
    o = 2 * (i * m).sum(axis=0) * m - i
    near = (o[2] > np.cos(1.3)) & (i[2] > np.cos(1.3))
    return i[:, near], o[:, near]


@pytest.mark.parametrize(
    ("alpha", "diffuse", "across", "size", "median"),
    [
        (0.1, 0.0, 0.0, TableSize(), 0.005),
        (0.3, 0.05, 0.0, TableSize(thetas=24, side=32), 0.005),
        (0.3, 0.02, 0.2, TableSize(17, 12, 24, (32, 64)), 0.02),  # 22° between azimuths
    ],
    ids=["facets", "with diffuse part", "anisotropic"],
)
def test_tables_of_a_brdf_are_near_it(tmp_path, alpha, diffuse, across, size, median):
    """Exact at its nodes, near it between them, in Mitsuba too."""
    brdf, path = facets(alpha, diffuse, across), tmp_path / "made.bsdf"
    write_tensors(path, tabulate(brdf, size, description="a test"))
    samples = read_brdf_samples(path, samples=500)
    light, viewer = directions_of(samples)
    exact = brdf(light, viewer)
    # float32 keeps 7 digits of the half vector's coordinates
    assert np.max(np.abs(samples.values - exact) / exact.max(axis=1, keepdims=True)) < 3e-4
    i, o = lobe(alpha, 3000)
    exact = brdf(i, o)
    missed = np.abs(load_rgl(path).evaluate(i, o) - exact) / exact.max(axis=1, keepdims=True)
    assert np.median(missed) < median
    assert np.quantile(missed, 0.95) < 10 * median
    theirs = measured(path, i[:, :50], o[:, :50], "scalar_rgb") / o[2, :50, None]
    assert np.median(np.abs(theirs - exact[:50]) / exact[:50].max(axis=1, keepdims=True)) < median
