"""Colours of films from files and photographs, against sums in NumPy and colour-science."""

import colour
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms

import pellicle as pl
from pellicle.data.colour_rows import is_colour_table, read_colour_rows
from pellicle.data.read_colours import read_colours, read_colours_by_film
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read, rows

RGB = np.array([[0.2, 0.41, 0.83], [0.5, 0.35, 0.11]])


@pytest.mark.parametrize(
    ("text", "space", "note"),
    [
        ("R,G,B\n" + rows(*RGB.T), "srgb", "as they are"),
        ("Blue;Green;Red\n" + rows(*RGB.T[::-1], mark=";").replace(".", ","), "srgb", "decimal commas"),
        ("r g b\n" + rows(*RGB.T, mark=" "), "srgb", "as they are"),
        ("R_8bit\tG_8bit\tB_8bit\n" + rows(*255 * RGB.T, mark="\t"), "srgb", "8-bit"),
        ("R (%),G (%),B (%)\n" + rows(*100 * RGB.T), "srgb", "percent"),
        ("# signal rgb, unpolarised\nR,G,B\n" + rows(*RGB.T), "rgb", "channels of a camera"),
        ("X,Y,Z\n" + rows(*RGB.T), "xyz", "Y = 1 is white"),
        ("X,Y,Z\n" + rows(*100 * RGB.T), "xyz", "divided by 100"),
        ("x,y,Y\n" + rows(*(RGB[:, :2] / RGB.sum(1, keepdims=True)).T, RGB[:, 1]), "xyz", "Y = 1 is white"),
    ],
)
def test_every_naming_and_scale(write, text, space, note):
    [film] = read_colour_rows(write(text))
    assert film.space == space
    np.testing.assert_allclose(film.values, RGB, atol=1e-9)
    assert note in " ".join(film.notes)
    assert_read(film, sigma=None, angle=None)
    assert is_colour_table(film.path)


def test_whole_numbers_are_8_bit_with_their_sigma(write):
    [film] = read_colour_rows(write("sigma,R,G,B\n2,51,102,255\n1,0,3,7\n"))
    np.testing.assert_allclose(film.values, np.array([[51, 102, 255], [0, 3, 7]]) / 255)
    np.testing.assert_allclose(film.sigma, np.array([[2] * 3, [1] * 3]) / 255)
    assert "divided by 255 (8-bit)" in " ".join(film.notes)


def test_films_by_name_with_angles_and_sigmas(write):
    header = "angle_deg,film,L*,a*,b*,sigma_L*,sigma_a*,sigma_b*,remark\n"
    text = header + "0,one,50,1,-2,.1,.2,.3,7\n0,two,60,3,4,.1,.2,.3,7\n45,one,55,2,-9,.4,.5,.6,7\n"
    one, two = read_colour_rows(write(text))
    assert (one.name, two.name) == ("one", "two")
    assert_read(one, angle=[0, 45], values=[[50, 1, -2], [55, 2, -9]])
    assert one.sigma[1].tolist() == [0.4, 0.5, 0.6]
    assert one.lines.tolist() == [2, 4]
    assert two.space == "lab"
    assert "ignored: remark" in one.notes


@pytest.mark.parametrize(
    ("text", "options", "error", "parts"),
    [
        ("R,G,B\n30.5,40.1,60.2\n", {}, UsageError, ("unclear unit", "signal_unit")),
        ("R,G,B\n0.1,0.2,-\n", {}, DataError, ("line 2", "'B'", "expected a number")),
        ("R,G,B\n0.1,0.2,0.3,0.4\n", {}, DataError, ("line 2", "4 values")),
        ("R,G,B\n", {}, DataError, ("no row",)),
        ("R,G,B\n0,0,256000\n", {}, UsageError, ("unclear unit",)),
        ("R,G,B\n0,0,300\n", {"unit": "8-bit"}, DataError, ("line 2", "300", "8-bit")),
        ("R,G,B\n0,0,3\n", {"unit": "fraction"}, DataError, ("line 2", "beyond 1")),
        ("X,Y,Z\n400,500,600\n", {}, DataError, ("beyond the 100",)),
        ("L*,a*,b*\n0.5,0.1,0.1\n", {}, DataError, ("0 to 100",)),
        ("L*,a*,b*\n500,1,1\n", {}, DataError, ("line 2", "no L*")),
        ("x,y,Y\n0.6,0.6,0.2\n", {}, DataError, ("line 2", "no chromaticity")),
        ("x,y,Y,sigma\n0.3,0.3,0.2,0.1\n", {}, UsageError, ("convert them to X, Y, Z",)),
        ("x,y,z\n0.3,0.3,0.2\n", {}, UsageError, ("no three columns",)),
        ("R,G,B,X,Y,Z\n0,0,0,0,0,0\n", {}, UsageError, ("more than one colour",)),
        ("R,G,B,sigma_R\n0,0,0,1\n", {}, DataError, ("one of each channel",)),
        ("R (%),G,B\n0,0,0\n", {}, DataError, ("different units",)),
        ("0.1,0.2,0.3\n", {}, UsageError, ("no header",)),
        ("X,Y,Z\n0.1,0.2,0.3\n", {"space": "lab"}, UsageError, ("in xyz, not in lab",)),
        ("# signal srgb\nR,G,B\n0.1,0.2,0.3\n", {"space": "rgb"}, UsageError, ("in srgb, not in rgb",)),
        ("", {}, DataError, ("is empty",)),
    ],
)
def test_what_is_damaged_or_unclear_is_refused(write, refusal, text, options, error, parts):
    refusal(read_colour_rows, write(text), error, *parts, **options)


def test_a_unit_that_is_none(write, refuses):
    refuses(UsageError, "signal_unit", read_colour_rows, write("R,G,B\n0.1,0.2,0.3\n"), unit="od")


def test_named_columns_replace_the_header(write):
    [film] = read_colour_rows(write("7,0.1,0.2,0.3\n"), columns="_,R,G,B")
    assert film.values.tolist() == [[0.1, 0.2, 0.3]]


@pytest.mark.parametrize(
    "text", ["wavelength_nm,R\n500,0.2\n", "theta_i,phi_i,theta_o,phi_o,R,G,B\n0,0,0,0,1,1,1\n", "500,0.2\n"]
)
def test_other_tables_are_no_colours(write, text):
    assert not is_colour_table(write(text))


RNG = np.random.default_rng(3)
PIXELS = RNG.integers(20, 200, (20, 30, 3), dtype=np.uint8)
PIXELS[:5, :5] = 0  # a dark corner
WHITE = np.array([230, 220, 180], np.uint8)


@pytest.fixture
def photo(tmp_path):
    def write(pixels=PIXELS, **options):
        path = tmp_path / "photo.png"
        Image.fromarray(pixels).save(path, **options)
        return path

    return write


def linear(coded):
    """sRGB decoded by colour-science, from 8 bits."""
    return colour.models.eotf_sRGB(coded / 255.0)


def coded(channels):
    return colour.models.eotf_inverse_sRGB(channels)


def test_the_mean_of_a_region_is_that_of_linear_light(photo):
    film = read_colours(photo(), region="5,6,10,8", angle=45.0)
    inside = PIXELS[6:14, 5:15].reshape(-1, 3)
    np.testing.assert_allclose(film.values[0], coded(linear(inside).mean(axis=0)), atol=2e-4)
    assert abs(film.values[0] - inside.mean(axis=0) / 255).max() > 0.02  # it is not the mean of the codes
    rounding = 1 / 255 / np.sqrt(12)
    np.testing.assert_allclose(film.sigma[0], np.hypot(inside.std(axis=0, ddof=1) / 255, rounding), rtol=1e-5)
    assert_read(film, angle=[45.0], space="srgb")
    assert "80 pixels in linear light" in " ".join(film.notes)
    assert "observer 1931 under D65" in film.notes


def test_division_by_a_white_in_linear_light(photo):
    pixels = PIXELS.copy()
    pixels[-4:, -4:] = WHITE
    pixels[10, 10] = [90, 200, 180]
    film = read_colours(photo(pixels), region=[10, 10, 1, 1], white="26,16,4,4")
    expected = coded(np.minimum(linear(pixels[10, 10]) / linear(WHITE), 1))
    np.testing.assert_allclose(film.values[0], expected, atol=2e-4)
    assert film.sigma is None  # one pixel has no scatter
    about = {"space": "rgb", "gamma": 2.2, "noise": 0.01}
    film = read_colours(photo(pixels), region=[8, 8, 5, 5], white="26,16,4,4", **about)
    inside = (pixels[8:13, 8:13].reshape(-1, 3) / 255.0) ** 2.2
    expected = (inside.mean(axis=0) / (WHITE / 255.0) ** 2.2) ** (1 / 2.2)
    np.testing.assert_allclose(film.values[0], expected, atol=1e-5)
    assert_read(film, sigma=[[0.01] * 3], gamma=2.2)


def test_a_flat_field_takes_uneven_light_away(tmp_path, refuses):
    """A surface of one colour that is lit from the left, beside its own clipped corner."""
    light = np.linspace(1.0, 0.3, 30)[None, :, None] * np.array([1.0, 0.9, 0.7])
    surface = np.array([0.3, 0.5, 0.2])
    paths = [tmp_path / name for name in ("film.tif", "white.tif", "small.tif", "clipped.tif")]
    white = 0.8 * light * np.ones((20, 1, 1))
    views = surface * white, white, white[:10], np.minimum(2 * white, 1.0)
    for path, view in zip(paths, views, strict=True):
        shown = np.round(65535 * coded(view)).astype(np.uint16)
        if path == paths[0]:
            shown[:2, :2] = 65535
        tifffile.imwrite(path, shown, photometric="rgb")
    for region in ("2,5,4,4", "24,5,4,4"):
        film = read_colours(paths[0], region=region, flat_field=paths[1])
        np.testing.assert_allclose(film.values[0], coded(surface), atol=1e-4)
        assert abs(read_colours(paths[0], region=region).values[0] - coded(surface)).max() > 0.02
    assert f"divided by the flat field {paths[1]}" in film.notes
    assert "clipped (bright), taken as a limit" in " ".join(
        read_colours(paths[0], region="0,0,3,3", flat_field=paths[1]).notes
    )
    for flat, reason in ((paths[2], "30 by 10 pixels"), (paths[3], "the flat field is clipped in")):
        refuses(UsageError, reason, read_colours, paths[0], region="2,5,4,4", flat_field=flat)


def test_regions_are_films_or_angles_of_one(photo, refused):
    path = photo()
    one, two = read_colours_by_film(path, points="10,10;20,15")
    assert (one.name, two.name) == ("8,8,5,5", "18,13,5,5")
    both = read_colours(path, points="10,10;20,15", angle=[0, 60])
    assert_read(both, angle=[0, 60], values=np.concatenate([one.values, two.values]))
    assert read_colours(path, points="10,10;20,15", name="18,13,5,5").values.tolist() == two.values.tolist()
    refused(path, "2 films", read=read_colours, error=UsageError, points="10,10;20,15")


def test_clipped_pixels_are_told_and_are_limits(photo):
    film = read_colours(photo(), region="0,0,5,6")
    assert film.values[0].tolist() == [0, 0, 0]
    assert "83 % of the pixels are clipped (dark), taken as a limit in R, G, B" in " ".join(film.notes)
    dark = read_colours(photo(), region="1,1,2,2")
    assert "up to 100 % of the pixels are clipped (dark)" in " ".join(dark.notes)
    few = read_colours(photo(), region="0,0,30,20")
    assert "4.2 % of the pixels are clipped" in " ".join(few.notes)
    assert few.values.min() > 0.2


def test_profiles_of_photographs(photo):
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("XYZ")).tobytes()
    path = photo(icc_profile=profile)
    with pytest.raises(DataError, match=r"colour profile 'XYZ.*convert the photograph to sRGB"):
        read_colours(path, region="1,1,3,3")
    assert "ignored" in " ".join(read_colours(path, region="6,6,3,3", space="rgb").notes)


def test_floating_point_values_are_taken_as_coded_and_the_note_says_so(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", (PIXELS / 255).astype(np.float32), photometric="rgb")
    region = "6,6,3,3"
    assumed, stated, linear = (
        read_colours(tmp_path / "a.tif", region=region, space=space) for space in (None, "srgb", "rgb")
    )
    np.testing.assert_array_equal(assumed.values, stated.values)
    [note] = [note for note in assumed.notes if "floating-point" in note]
    assert 'coded in sRGB: give `space="rgb"`' in note
    assert not any("floating-point" in note for note in (*stated.notes, *linear.notes))
    inside = PIXELS[6:9, 6:9].reshape(-1, 3)
    np.testing.assert_allclose(linear.values[0], inside.mean(axis=0) / 255, atol=1e-6)


@pytest.fixture
def camera(tmp_path):
    nm = np.arange(400, 721, 10.0)
    bands = np.exp(-(((nm[:, None] - [600, 540, 460]) / 30) ** 2)) * [1, 2, 0.5]
    lamp = 1 + (nm - 400) / 320
    rows = zip(nm, *bands.T, lamp, strict=True)
    table = [",".join(f"{x:.8g}" for x in row) for row in rows]
    bare = [row.rpartition(",")[0] for row in table]
    (tmp_path / "camera.csv").write_text("\n".join(["wavelength_nm,R,G,B", *bare]))
    (tmp_path / "lamp.csv").write_text("wavelength_nm,power\n380,0.9375\n780,2.1875\n")
    (tmp_path / "c.csv").write_text("angle_deg,R,G,B\n0,.2,.3,.4\n")
    return tmp_path, nm, bands, lamp


def test_a_camera_and_its_lamp_from_files(camera):
    folder, nm, bands, lamp = camera
    tables = {"sensitivities": folder / "camera.csv", "lamp": folder / "lamp.csv"}
    film = pl.read_colours(folder / "c.csv", space="rgb", **tables)
    at, weights = film.sensor
    fine = np.linspace(400, 720, 32_001)
    seen = np.stack([np.interp(fine, nm, band) for band in bands.T]) * np.interp(fine, nm, lamp)
    expected = (seen * (0.5 + 0.3 * np.sin(fine / 40))).sum(1) / seen.sum(1)
    np.testing.assert_allclose((0.5 + 0.3 * np.sin(at / 40)) @ weights, expected, atol=3e-4)
    assert "camera.csv under" in " ".join(film.notes)


def test_a_camera_by_its_chart(tmp_path):
    truth = np.array([[2.0, -0.6, -0.3], [-0.4, 1.5, -0.1], [0.1, -0.3, 0.9]])
    xyz = RNG.uniform(0.1, 0.5, (18, 3)) * [0.95, 1, 1.09]
    xyz = xyz[np.all(xyz @ truth.T > 0.02, axis=1)]
    rgb = (xyz @ truth.T) ** (1 / 2.2)
    rows = "".join(",".join(f"{x:.9g}" for x in row) + "\n" for row in np.hstack([rgb, xyz]))
    (tmp_path / "chart.csv").write_text("R,G,B,X,Y,Z\n" + rows)
    (tmp_path / "c.csv").write_text("R,G,B\n.2,.3,.4\n")
    film = pl.read_colours(tmp_path / "c.csv", space="rgb", gamma=2.2, chart=tmp_path / "chart.csv")
    np.testing.assert_allclose(film.camera.matrix, truth, atol=1e-5)
    assert "misfit ΔE2000" in " ".join(film.notes)
    # its sensor is the observer
    np.testing.assert_allclose(film.sensor[1].sum(axis=0), [0.9505, 1, 1.089], atol=2e-3)


@pytest.mark.parametrize(
    ("options", "error", "reason"),
    [
        ({"space": "rgb", "sensitivities": "a.csv", "chart": "b.csv"}, UsageError, "exclude each other"),
        ({"sensitivities": "a.csv"}, UsageError, "goes with"),
        ({"lamp": "a.csv", "illuminant": "A"}, UsageError, "exclude each other"),
        ({"lamp": "a.csv"}, DataError, "no such file"),
        ({"observer": "1930"}, UsageError, "1930"),
        ({"illuminant": "F2"}, UsageError, "F2"),
        ({"gamma": 2.2}, UsageError, "gamma"),
        ({"space": "rgb", "gamma": 0.0}, UsageError, "`gamma` must be a number from"),
        ({"white_balance": "free"}, UsageError, "white_balance"),
        ({"region": "1,1,2,2"}, UsageError, "no photograph"),
        ({"angle": 30.0}, UsageError, "own angles"),
        ({"noise": 1.5}, UsageError, "divide 8-bit values"),
        ({"noise": -1.0}, UsageError, "above zero"),
        ({"signal": "srgb"}, UsageError, "R or T"),
    ],
)
def test_what_does_not_go_together(camera, options, error, reason, refuses):
    refuses(error, reason, read_colours, camera[0] / "c.csv", **options)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({}, "30 by 20 pixels: give `region"),
        ({"region": "1,1,2,2", "points": "1,1"}, "`points` exclude each other"),
        ({"region": "1,1,2,2", "space": "lab"}, "a photograph has"),
        ({"region": "1,1,2,2", "white": "0,0,4,4"}, "is black in 100 %"),
        ({"region": "1,1,2,2", "angle": [1, 2]}, "2 angles are given for 1 regions"),
        ({"region": "1,1,2,2", "columns": "R,G,B"}, "leave `columns`"),
    ],
)
def test_what_a_photograph_needs(photo, options, reason, refuses):
    refuses(UsageError, reason, read_colours, photo(), **options)
