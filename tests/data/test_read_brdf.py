"""Samples of a BRDF in text: what is written comes back, what is impossible is refused in one sentence."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pellicle as pl
from pellicle.data.brdf_samples import BrdfSamples, spread, write_brdf_samples
from pellicle.data.read_brdf import read_brdf_samples
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read

HEADER = "theta_i,phi_i,theta_o,phi_o,R,G,B\n"
ROW = "30,0,40,180,0.1,0.2,0.3\n"
ALTA = "#DIM 4 1\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT INV_STERADIAN\n"


@pytest.fixture
def refused(refusal):
    return partial(refusal, read_brdf_samples)


@st.composite
def measured(draw):
    """The parts of any samples that a file may hold."""
    size = draw(st.integers(1, 6))
    channels = draw(st.sampled_from([("value",), ("R", "G", "B")]))

    def array(low, high, *shape):
        flat = st.lists(st.floats(low, high), min_size=int(np.prod(shape)), max_size=int(np.prod(shape)))
        return np.reshape(draw(flat), shape)

    sigma = array(1e-6, 10, size, len(channels)) if draw(st.booleans()) else None
    theta_i = array(2, 90, size)  # all below 1.57 would look like radians
    theta_o, phi_i, phi_o = array(0, 90, size), array(-180, 360, size), array(-180, 360, size)
    values = array(0, 1e4, size, len(channels))
    return theta_i, phi_i, theta_o, phi_o, values, channels, sigma


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("brdf") / "paint"


@settings(max_examples=40)
@given(parts=measured())
def test_what_is_written_is_read_again(place, parts):
    samples = BrdfSamples(*parts)
    write_brdf_samples(place, samples, overwrite=True)
    read = read_brdf_samples(place)
    assert read.channels == samples.channels
    for name in ("theta_i", "phi_i", "theta_o", "phi_o", "values", "sigma"):
        expected = getattr(samples, name)
        if expected is None:
            assert getattr(read, name) is None
        else:
            np.testing.assert_allclose(getattr(read, name), expected, rtol=1e-13, atol=1e-300, err_msg=name)


def test_a_csv_says_what_was_read(write):
    path = write("theta_i_deg;phi_i;theta_o (deg);phi_o;R (1/sr);G;B;x;sigma\n30;0;40;180;1;2;3;9;0.5\n")
    read = pl.read_brdf_samples(path)
    assert_read(read, values=[[1, 2, 3]], sigma=[[0.5, 0.5, 0.5]])
    assert (read.theta_o[0], read.phi_o[0], read.lines[0]) == (40, 180, 2)
    assert "ignored: 'x'" in read.notes
    assert str(read) == f"{path}: 1 samples of R, G, B"
    assert not read.values.flags.writeable


def test_columns_by_flag_and_by_comment(write):
    path = write("30 0 7 40 180 0.1\n31 0 7 41 180 0.2\n")
    read = read_brdf_samples(path, columns="theta_i,phi_i,_,theta_o,phi_o,value")
    assert_read(read, channels=("value",), theta_o=[40, 41])
    read = read_brdf_samples(write("# theta_i phi_i theta_o phi_o value\n30 0 40 180 0.1\n"))
    np.testing.assert_array_equal(read.values, [[0.1]])


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("30,0,90.1,180,1,1,1", "theta_o: 90.1 degrees is below the horizon"),
        ("30,0,40,180,1,-0.001,1", "G: -0.001 is a BRDF below zero"),
        ("30,0,40,180,1,nan,1", "column 'G': nan is not a finite number"),
        ("30,0,x,180,1,1,1", "column 'theta_o': expected a number but found 'x'"),
        ("30,0,40,180,1,,1", "column 'G' is empty"),
        ("30,0,40,180,1,1", "column 'B' is empty"),
        ("30,0,40,180,1,1,1,1", "8 values"),
    ],
)
def test_a_row_that_cannot_be(write, row, said, refused):
    refused(write(HEADER + ROW + row + "\n" + ROW), DataError, "line 3", said)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("phi_i,theta_o,phi_o,R,G,B", "no column is theta_i among"),
        ("theta_i,phi_i,theta_o,phi_o,R,B", "no column is G among"),
        ("theta_i,phi_i,theta_o,phi_o", "no column is value among"),
        ("theta_i,phi_i,theta_o,phi_o,R,G,B,sigma_R", "no column is sigma_G, sigma_B among"),
        ("wavelength,R", "no column is theta_i, phi_i, theta_o, phi_o among"),
        ("theta_i (rad),phi_i,theta_o,phi_o,value", "'rad'; write directions in degrees"),
        ("theta_i,phi_i,theta_o,phi_o,value (%)", "'percent'; write the BRDF in 1/sr"),
        ("theta_i,theta_i,theta_o,phi_o,value", "twice"),
    ],
)
def test_columns_that_are_missing_or_wrong(write, header, said, refused):
    cells = ",".join(["30"] * (header.count(",") + 1))
    refused(write(f"{header}\n{cells}\n{cells}\n"), DataError, said)


def test_columns_that_only_the_user_can_tell(write, refused):
    refused(write(ROW), UsageError, "has no header", '`columns=["theta_i"')
    both = write("theta_i,phi_i,theta_o,phi_o,value,R,G,B\n30,0,40,180,1,1,1,1\n")
    refused(both, UsageError, "value as well as")


def test_standard_deviations_above_zero(write, refused):
    path = write("theta_i,phi_i,theta_o,phi_o,value,sigma\n30,0,40,180,1,0.1\n30,0,41,180,1,0\n")
    refused(path, DataError, "line 3", "standard deviation of value: 0 is not above zero")


def test_radians_are_not_taken_for_degrees(write, refused):
    rows = "0.5,0,0.7,3.14,1\n0.6,0,1.5,3.14,1\n"
    refused(write("theta_i,phi_i,theta_o,phi_o,value\n" + rows), DataError, "look like radians", "in degrees")
    read = read_brdf_samples(write("theta_i_deg,phi_i,theta_o,phi_o,value\n" + rows))
    np.testing.assert_array_equal(read.theta_o, [0.7, 1.5])


def test_files_that_hold_no_samples(write, tmp_path, refused):
    refused(tmp_path / "gone.csv", DataError, "no such file")
    refused(tmp_path, DataError, "is a folder")
    refused(write(""), DataError, "is empty", "expected rows")
    refused(write("# nothing\n"), DataError, "only comments")
    refused(write(HEADER), DataError, "without any row of two numbers")
    refused(write("a story\nof two lines\n"), DataError, "without any row of two numbers")
    (tmp_path / "x.png").write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\x00\x0dIHDR")
    refused(tmp_path / "x.png", DataError, "is an image", "as a CSV")


def test_records_of_the_wrong_shape_are_refused(refuses):
    with pytest.raises(ValueError, match=r"`values`: expected the shape \(1, 3\), got \(1, 1\)"):
        BrdfSamples(*np.ones((4, 1)), np.ones((1, 1)), ("R", "G", "B"))
    refuses(ValueError, "`channels`: expected", BrdfSamples, *np.ones((4, 1)), np.ones((1, 1)), ("X",))


@given(count=st.integers(0, 5000), samples=st.integers(1, 6000))
def test_a_choice_holds_no_sample_twice_and_leaves_no_gap(count, samples):
    kept = spread(count, samples)
    assert kept.size == min(count, samples)
    assert np.unique(kept).size == kept.size
    assert np.isin(spread(count, max(1, samples // 2)), kept).all()
    if kept.size:
        # the three-gap theorem: at most φ² = 2.618 times the mean
        assert np.diff(kept, prepend=-1, append=count).max() <= 2.62 * count / kept.size


def test_fewer_samples_of_a_text_file(write, refuses):
    rows = "".join(f"{theta},0,40,180,1,1,{theta}\n" for theta in range(80))
    path = write(HEADER + rows)
    read = read_brdf_samples(path, samples=8)
    assert len(read) == 8
    np.testing.assert_array_equal(read.values[:, 2], read.theta_i)
    np.testing.assert_array_equal(read.lines, read.theta_i + 2)
    assert "8 of 80 samples kept, spread over the file" in read.notes
    assert len(read_brdf_samples(path, samples=200)) == 80
    refuses(UsageError, "`samples` must be above zero, got 0", read_brdf_samples, path, samples=0)


#: One pair of directions in each of ALTA's ways: light (40°, 0°), view (25°, 130°).
LIGHT, VIEW, AZIMUTH = np.deg2rad(40), np.deg2rad(25), np.deg2rad(130)


def half_and_difference(light, view, turned):
    """θ_h, φ_h, θ_d, φ_d of Rusinkiewicz (1998), by two explicit rotations of the vector `turned`."""
    h = (light + view) / np.linalg.norm(light + view)
    theta, phi = np.arccos(h[2]), np.arctan2(h[1], h[0])
    about_z = np.array([[np.cos(phi), np.sin(phi), 0], [-np.sin(phi), np.cos(phi), 0], [0, 0, 1]])
    about_y = np.array([[np.cos(theta), 0, -np.sin(theta)], [0, 1, 0], [np.sin(theta), 0, np.cos(theta)]])
    d = about_y @ about_z @ turned
    return theta, phi, np.arccos(d[2]), np.arctan2(d[1], d[0])


def alta_rows():
    light = np.array([np.sin(LIGHT), 0, np.cos(LIGHT)])
    view = np.array([np.sin(VIEW) * np.cos(AZIMUTH), np.sin(VIEW) * np.sin(AZIMUTH), np.cos(VIEW)])
    half = half_and_difference(light, view, view)
    return {
        "SPHERICAL_TL_PL_TV_PV": (LIGHT, 0.0, VIEW, AZIMUTH),
        "ISOTROPIC_TV_TL_DPHI": (VIEW, LIGHT, -AZIMUTH),
        "ISOTROPIC_TL_TV_PROJ_DPHI": (LIGHT, VIEW * np.cos(AZIMUTH), VIEW * np.sin(AZIMUTH)),
        "RUSIN_TH_PH_TD_PD": half,
        "RUSIN_TH_TD_PD": (half[0], half[2], half[3]),
        "CARTESIAN": (*view, *light),
    }


@pytest.mark.parametrize("name", alta_rows())
def test_parametrisations_of_alta(write, name):
    row = alta_rows()[name]
    cells = "\t".join(repr(float(value)) for value in (*row, 0.5)) + "\t"
    path = write(
        f"# a tape\nany words\n#DIM {len(row)} 1\n#PARAM_IN  {name}\n#PARAM_OUT INV_STERADIAN\n{cells}\n"
    )
    read = read_brdf_samples(path)
    np.testing.assert_allclose([read.theta_i[0], read.theta_o[0]], [40, 25], rtol=1e-12)
    assert (read.phi_o[0] - read.phi_i[0]) % 360 == pytest.approx(130, rel=1e-12)
    np.testing.assert_array_equal(read.values, [[0.5]])
    assert read.lines[0] == 6
    assert read.notes[0] == f"read as an ALTA text file of {name} (radians) and INV_STERADIAN"


@pytest.mark.parametrize(("values", "names"), [("0.5", "value"), ("0.5 0.6 0.7", "R, G, B")])
def test_alta_without_its_meaning_is_known_by_its_columns(write, values, names):
    count = len(values.split())
    read = read_brdf_samples(
        write(f"#DIM 4 {count}\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n0.5 0 1 3.1 {values}\n")
    )
    assert read.values.tolist() == [[float(each) for each in values.split()]]
    assert f"{names} in 1/sr, since it has no #PARAM_OUT" in read.notes[0]


def test_samples_near_grazing_are_left_out(write, refused, refuses):
    rows = "10,0,20,180,1\n80,0,20,180,2\n20,0,75,180,3\n60,0,5,0,4\n"
    path = write(f"theta_i,phi_i,theta_o,phi_o,value\n{rows}")
    read = read_brdf_samples(path, max_theta=75)
    assert read.values.ravel().tolist() == [1, 3, 4]
    assert read.notes[-1] == "left out: 1 samples more than 75 degrees from the normal"
    refused(path, DataError, "no sample within 5 degrees", max_theta=5)
    refuses(UsageError, "`max_theta` must lie above 0", read_brdf_samples, path, max_theta=0)


def test_intervals_and_cosines_of_alta(write, refused):
    header = ALTA.replace("INV_STERADIAN", "INV_STERADIAN_COSINE_FACTOR")
    read = read_brdf_samples(write(header + f"#VS 2\n0.5 0 {np.pi / 3!r} 3.1 0.2 0.1 0.5\n"))
    np.testing.assert_allclose(read.values, [[0.4]], rtol=1e-14)  # cos 60° = 1/2
    np.testing.assert_allclose(read.sigma, [[0.4]], rtol=1e-14)  # half of 0.5 - 0.1, over 1/2
    read = read_brdf_samples(write(ALTA.replace("4 1", "4 3") + "#VS 1 0 1\n0.5 0 1 3.1 1 2 3 0.1 0.3\n"))
    assert read.sigma is None
    assert "intervals (#VS) ignored, since not every channel has one" in read.notes
    refused(write(header + "0.5 0 1.5708 3.1 0.2\n"), DataError, "line 4: theta_o is 90 degrees", "delete")
    assert read_brdf_samples(write(ALTA + "0.5 0 1.5708 3.1 0.2\n")).theta_o[0] == 90


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (ALTA.replace("#DIM 4 1\n", "") + "1 0 1 0 1\n", ("without #DIM",)),
        (ALTA.replace("SPHERICAL_TL_PL_TV_PV", "COS_TH") + "1 0 1 0 1\n", ("line 2", "COS_TH", "SPHERICAL")),
        (ALTA.replace("INV_STERADIAN", "XYZ") + "1 0 1 0 1\n", ("line 3", "XYZ", "INV_STERADIAN")),
        (ALTA.replace("4 1", "4 2") + "1 0 1 0 1 1\n", ("line 1: #DIM 4 2", "4 1 or 4 3")),
        (ALTA.replace("4 1", "3 1") + "1 0 1 1\n", ("line 1: #DIM 3 1", "4 1 or 4 3")),
        (ALTA + "#VS 3\n1 0 1 0 1\n", ("line 4: #VS 3", "0, 1 or 2")),
        ("1 2\n" + ALTA, ("no rows",)),
        (ALTA + "1 0 1 0 -1\n", ("line 4: value: -1 is a BRDF below zero",)),
        (ALTA + "1 0 1.7 0 1\n", ("line 4: theta_o: 97.4028 degrees is below the horizon",)),
        (ALTA + "1 0 1 0 1\n1 0 1 x 1\n", ("line 5, column 'phi_v'", "'x'")),
        (ALTA + "1 0 1 0 1\n1 0 1 0 1 1\n", ("line 5 has 6 values",)),
    ],
)
def test_alta_files_that_are_refused(write, text, said, refused):
    refused(write(text), DataError, *said)


MEASURED = {"alta_retro-gray-tape": 7233, "nist_ptfe_633_532": 1824, "nbrdf_two-layer-gold": 2286}


@pytest.mark.parametrize("name", MEASURED)
def test_files_beside_the_repository(shared_data, tmp_path, name):
    path = shared_data / "brdf" / f"{name}.csv"
    expected = np.loadtxt(path, delimiter=",", skiprows=1)
    read = read_brdf_samples(path)
    assert len(read) == MEASURED[name]
    directions = np.stack([read.theta_i, read.phi_i, read.theta_o, read.phi_o], 1)
    np.testing.assert_array_equal(directions, expected[:, :4])
    np.testing.assert_array_equal(read.values, expected[:, 4:7])
    if name.startswith("alta"):  # its raw column as ALTA would write it gives the same BRDF
        alta = tmp_path / "tape.alta"
        rows = np.column_stack([np.deg2rad(expected[:, :4]), expected[:, 7]])
        header = ALTA.replace("INV_STERADIAN", "INV_STERADIAN_COSINE_FACTOR")
        np.savetxt(alta, rows, header=header.rstrip("\n").removeprefix("#"), comments="#", fmt="%.15g")
        alta.write_text(alta.read_text().replace("##", "#"))
        np.testing.assert_allclose(read_brdf_samples(alta).values[:, 0], expected[:, 4], rtol=2e-5)
