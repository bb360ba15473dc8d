"""MERL files: each value comes with the directions of its cell, as the database's own look-up has it."""

import hashlib

import numpy as np
import pytest

from pellicle.data.brdf_samples import angles, from_half_difference, vectors
from pellicle.data.read_brdf import read_brdf_samples
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read
from tests.directions import unit

SHAPE = (90, 90, 180)
CELLS = 90 * 90 * 180
SCALE = np.array([1.0, 1.15, 1.66]) / 1500


def rotated(vector, axis, angle):
    """Rodrigues: a vector turned about a unit axis."""
    along = np.dot(axis, vector) * axis
    return along + np.cos(angle) * (vector - along) + np.sin(angle) * np.cross(axis, vector)


def half_difference(light, eye):
    """θ_h, φ_h, θ_d, φ_d as Rusinkiewicz (1998) defines them: the light, turned back with the half vector."""
    half = (light + eye) / np.linalg.norm(light + eye)
    theta_h, phi_h = np.arccos(half[2]), np.arctan2(half[1], half[0])
    d = rotated(rotated(light, np.array([0.0, 0, 1]), -phi_h), np.array([0.0, 1, 0]), -theta_h)
    return theta_h, phi_h, np.arccos(d[2]), np.arctan2(d[1], d[0])


def cell(light, eye):
    """The cell that the database's own look-up takes for a pair of directions."""
    theta_h, _, theta_d, phi_d = half_difference(light, eye)
    return np.array(
        [np.sqrt(theta_h / (np.pi / 2) * 90 * 90), theta_d / (np.pi / 2) * 90, phi_d % np.pi / np.pi * 180]
    ).astype(int)


@pytest.fixture(scope="module")
def numbered(tmp_path_factory):
    """A file whose every value tells its cell, with one negative channel in each tenth row of θ_d."""
    path = tmp_path_factory.mktemp("merl") / "numbered.binary"
    values = np.arange(CELLS) * np.array([[1.0], [2.0], [3.0]]) / SCALE[:, None]
    values.reshape(3, *SHAPE)[1, :, ::10] = -1
    with path.open("wb") as file:
        np.array(SHAPE, "<i4").tofile(file)
        values.astype("<f8").tofile(file)
    return path


def test_each_value_has_the_directions_of_its_cell(numbered):
    read = read_brdf_samples(numbered, samples=2000)
    assert_read(read, channels=("R", "G", "B"), values=read.values[:, :1] * [1, 2, 3])
    number = np.round(read.values[:, 0]).astype(int)
    assert np.unique(number).size == len(read) == 2000
    expected = np.stack(np.unravel_index(number, SHAPE), axis=1)
    assert (expected[:, 1] % 10 > 0).all()
    pairs = zip(read.theta_i, read.phi_i, read.theta_o, read.phi_o, strict=True)
    found = [cell(unit(ti, pi), unit(to, po)) for ti, pi, to, po in pairs]
    np.testing.assert_array_equal(found, expected)
    assert (read.phi_i == 0).all()
    assert max(read.theta_i.max(), read.theta_o.max()) < 90


def test_what_is_left_out_is_counted(numbered):
    read = read_brdf_samples(numbered)
    h, d, p = np.meshgrid(np.arange(90), np.arange(90), np.arange(180), indexing="ij")
    theta_h, theta_d, phi_d = (h + 0.5) ** 2 / 90, d + 0.5, p + 0.5
    # the spherical law of cosines in the triangle of normal, half vector and direction
    near, far = (
        np.cos(np.deg2rad(theta_h)) * np.cos(np.deg2rad(theta_d))
        + sign * np.sin(np.deg2rad(theta_h)) * np.sin(np.deg2rad(theta_d)) * np.cos(np.deg2rad(phi_d))
        for sign in (-1, 1)
    )
    above = (near > 0) & (far > 0)
    invalid = above & (d % 10 == 0)
    assert len(read) == 10_000
    assert read.notes[1:] == (
        f"10000 of {above.sum() - invalid.sum()} valid cells kept, spread over the grid",
        f"left out: {(~above).sum()} cells with a direction below the surface, {invalid.sum()} invalid "
        "(negative) ones",
    )
    assert read.sha256 == hashlib.sha256(numbered.read_bytes()).hexdigest()
    # the choice is spread as evenly as random draws would be: Kolmogorov-Smirnov at 1 % over each axis
    number = np.round(read.values[:, 0]).astype(int)
    valid = np.flatnonzero(above & ~invalid)
    for axis, size in enumerate(SHAPE):
        both = (np.unravel_index(n, SHAPE)[axis] for n in (number, valid))
        shares = [np.bincount(cells, minlength=size) / cells.size for cells in both]
        assert np.abs(np.cumsum(shares[0] - shares[1])).max() < 1.63 / np.sqrt(len(read))


def test_the_same_choice_every_time_and_larger_ones_hold_it(numbered, refuses):
    small, again, large = (read_brdf_samples(numbered, samples=n).values[:, 0] for n in (300, 300, 700))
    np.testing.assert_array_equal(small, again)
    assert np.isin(small, large).all()
    refuses(UsageError, "`samples` must be above zero, got 0", read_brdf_samples, numbered, samples=0)


def test_single_entries_with_their_scale(tmp_path):
    path = tmp_path / "sparse.binary"
    with path.open("wb") as file:
        np.array(SHAPE, "<i4").tofile(file)
        file.truncate(12 + 8 * 3 * CELLS)
    cells = np.memmap(path, "<f8", "r+", offset=12, shape=(3, *SHAPE))
    cells[:] = -1
    cells[:, 0, 29, 89] = 1500, 3000, 4500
    cells[2, 5, 5, 5] = np.nan
    cells[:2, 5, 5, 5] = 1
    cells[:, 6, 6, 6] = 1, np.inf, 1
    cells.flush()
    read = read_brdf_samples(path)
    # θ_h = 1/360°, so light and eye mirror each other at 29.5° nearly; φ_d = 89.5° turns them sideways
    np.testing.assert_allclose(read.values, [[1.0, 2.3, 4.98]], rtol=1e-15)
    np.testing.assert_allclose([read.theta_i, read.theta_o], [[29.5], [29.5]], atol=0.003)
    np.testing.assert_allclose(read.phi_o, 180, atol=0.02)


def head(path, shape, size):
    with path.open("wb") as file:
        np.array(shape, "<i4").tofile(file)
        file.truncate(size)
    return path


@pytest.mark.parametrize(
    ("shape", "size", "said"),
    [
        (SHAPE, 12, r"is cut short, 12 bytes where a MERL file has 34992012; download it again"),
        (SHAPE, 34992011, r"is cut short, 34992011 bytes"),
        (SHAPE, 34992013, r"is too long, 34992013 bytes"),
        ((90, 90, 360), 69984012, r"MERL file of 90 x 90 x 360 cells, where 90 x 90 x 180 .*convert it"),
    ],
)
def test_files_that_are_refused(tmp_path, shape, size, said, refuses):
    path = head(tmp_path / "cut.binary", shape, size)
    refuses(DataError, rf"^{path}: .*{said}", read_brdf_samples, path)


def test_a_file_without_a_valid_cell(tmp_path, refused):
    path = head(tmp_path / "void.binary", SHAPE, 34992012)
    np.memmap(path, "<f8", "r+", offset=12, shape=(3, *SHAPE))[:] = -1
    refused(path, "has no valid cell", read=read_brdf_samples, error=DataError)


def test_half_and_difference_angles_there_and_back():
    random = np.random.default_rng(0)
    theta_h, theta_d = random.uniform(0.01, 1.5, (2, 100))
    phi_h, phi_d = random.uniform(-3.1, 3.1, (2, 100))
    first, second = from_half_difference(theta_h, phi_h, theta_d, phi_d)
    np.testing.assert_allclose(np.linalg.norm([first, second], axis=1), 1, rtol=1e-14)
    back = [half_difference(a, b) for a, b in zip(first.T, second.T, strict=True)]
    np.testing.assert_allclose(back, np.stack([theta_h, phi_h, theta_d, phi_d], 1), rtol=1e-9, atol=1e-12)
    # reciprocity: to swap light and eye is to turn the difference vector by half a circle
    swapped = from_half_difference(theta_h, phi_h, theta_d, phi_d + np.pi)
    np.testing.assert_allclose(swapped, [second, first], atol=1e-14)
    np.testing.assert_allclose(vectors(*angles(3 * first)), first, atol=1e-14)
