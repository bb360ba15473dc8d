"""Photographs of any depth and layout give the pixels that were written; others are refused."""

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms, ImageOps

from pellicle.data.photographs import (
    Region,
    image_format,
    parse_points,
    parse_regions,
    read_photograph,
    strip,
)
from pellicle.errors import DataError, UsageError
from tests.data.tables import assert_read

PIXELS = np.random.default_rng(0).integers(0, 256, (12, 20, 3), dtype=np.uint8)


def by_pillow(path, values=PIXELS, **options):
    Image.fromarray(values).save(path, **options)
    return path


def by_tifffile(path, values, **options):
    tifffile.imwrite(path, values, **options)
    return path


def palette(path):
    photograph = Image.fromarray(np.arange(240, dtype=np.uint8).reshape(12, 20) % 7, "P")
    photograph.putpalette([10, 20, 30, 40, 50, 60, 70, 80, 90] + [5, 6, 7] * 4)
    photograph.save(path)
    return path


LAYOUTS = {
    "png": lambda p: by_pillow(p / "a.png"),
    "opaque alpha": lambda p: by_pillow(p / "a.png", np.dstack([PIXELS, np.full((12, 20), 255, np.uint8)])),
    "tiff": lambda p: by_pillow(p / "a.tif"),
    "16 bits": lambda p: by_tifffile(p / "a.tif", PIXELS.astype(np.uint16) * 257, photometric="rgb"),
    "planes": lambda p: by_tifffile(
        p / "a.tif", np.moveaxis(PIXELS, -1, 0), photometric="rgb", planarconfig="separate"
    ),
    "float": lambda p: by_tifffile(p / "a.tif", (PIXELS / 255).astype(np.float32), photometric="rgb"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_pixels_of_every_layout(tmp_path, layout):
    path = LAYOUTS[layout](tmp_path)
    photograph = read_photograph(path)
    np.testing.assert_allclose(photograph.pixels, PIXELS / 255, atol=1e-7)
    assert_read(photograph, size=(20, 12), profile="")
    assert photograph.step == pytest.approx({"16 bits": 1 / 65535, "float": 1 / 65535}.get(layout, 1 / 255))


def test_palette_and_jpeg_are_told(tmp_path):
    coloured = read_photograph(palette(tmp_path / "p.png"))
    np.testing.assert_allclose(coloured.pixels[0, 1] * 255, [40, 50, 60], atol=1e-4)
    assert "palette converted to R, G, B" in coloured.notes
    photo = read_photograph(by_pillow(tmp_path / "p.jpg"))
    assert "compression" in " ".join(photo.notes)
    assert image_format(tmp_path / "p.jpg") == "JPEG"


def test_a_turned_photo_is_upright(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6  # the camera was turned by 90 degrees
    path = by_pillow(tmp_path / "a.png", exif=exif)
    np.testing.assert_allclose(read_photograph(path).pixels, np.rot90(PIXELS, -1) / 255, atol=1e-7)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_turned_tiff_is_upright(tmp_path, orientation):
    """As Pillow turns it; every orientation of TIFF 6.0."""
    tag = [(274, 3, 1, orientation, True)]
    path = by_tifffile(tmp_path / "a.tif", PIXELS, photometric="rgb", extratags=tag)
    with Image.open(path) as image:
        expected = np.asarray(ImageOps.exif_transpose(image))
    np.testing.assert_allclose(read_photograph(path).pixels, expected / 255, atol=1e-7)


def test_profiles_other_than_srgb_are_named(tmp_path):
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    lab = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()
    assert read_photograph(by_pillow(tmp_path / "a.png", icc_profile=srgb)).profile == ""
    assert "Lab" in read_photograph(by_pillow(tmp_path / "b.png", icc_profile=lab)).profile
    tagged = by_tifffile(tmp_path / "c.tif", PIXELS, photometric="rgb", iccprofile=lab)
    assert "Lab" in read_photograph(tagged).profile


def truncated(path):
    by_pillow(path)
    path.write_bytes(path.read_bytes()[:300])
    return path


def starting(path, content):
    path.write_bytes(content + bytes(200))
    return path


REFUSED = {
    "no photograph": (lambda p: starting(p / "a.xyz", b"photograph"), "is no PNG"),
    "bmp": (lambda p: by_pillow(p / "a.bmp"), "save it as PNG or TIFF"),
    "webp": (lambda p: by_pillow(p / "a.webp"), "save it as PNG or TIFF"),
    "heic": (lambda p: starting(p / "a.heic", b"\0\0\0\x18ftypheic"), "in HEIC or AVIF; save it as PNG"),
    "raw": (lambda p: starting(p / "a.raf", b"FUJIFILMCCD-RAW "), "raw file; develop it"),
    "preview": (
        lambda p: by_tifffile(p / "a.nef", PIXELS, photometric="rgb", subfiletype=1),
        "raw file, whose first image is a preview",
    ),
    "dng": (
        lambda p: by_tifffile(
            p / "a.dng", PIXELS, photometric="rgb", extratags=[(50706, 1, 4, (1, 4, 0, 0), True)]
        ),
        "raw file, whose first image is a preview",
    ),
    "grey": (lambda p: by_pillow(p / "a.png", PIXELS[..., 0]), "is grey"),
    "grey tiff": (lambda p: by_tifffile(p / "a.tif", PIXELS[..., 0], photometric="minisblack"), "is grey"),
    "transparent": (lambda p: by_pillow(p / "a.png", np.dstack([PIXELS, PIXELS[..., 0]])), "transparent"),
    "bright": (
        lambda p: by_tifffile(p / "a.tif", PIXELS * np.float32(1), photometric="rgb"),
        "beyond 0 to 1",
    ),
    "truncated png": (lambda p: truncated(p / "a.png"), "cannot be decoded"),
    "truncated tiff": (lambda p: truncated(p / "a.tif"), "cannot be decoded"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_photograph_is_refused(tmp_path, refusal, case):
    write, reason = REFUSED[case]
    refusal(read_photograph, write(tmp_path), DataError, reason)


def test_regions_and_points(tmp_path, refuses):
    photograph = read_photograph(by_pillow(tmp_path / "a.png"))
    one, two = parse_regions("2,3,4,5; 0,0,1,1")
    assert parse_regions([[2, 3, 4, 5], [0, 0, 1, 1]]) == [one, two]
    assert parse_regions([2, 3, 4, 5]) == [one]
    np.testing.assert_allclose(one.pixels(photograph), PIXELS[3:8, 2:6].reshape(-1, 3) / 255, atol=1e-7)
    assert parse_points("0,0;10,6", photograph) == [Region(0, 0, 3, 3), Region(8, 4, 5, 5)]
    for wrong in ("1,2,3", "1,2,a,4", "", "1.5,2,3,4"):
        refuses(UsageError, "region", parse_regions, wrong)
    for region in (Region(18, 0, 3, 1), Region(-1, 0, 3, 1), Region(0, 0, 0, 1)):
        refuses(UsageError, "`region`", region.pixels, photograph)
    refuses(UsageError, "20 by 12", parse_points, "20,0", photograph)


def test_messages_on_damaged_and_transparent_photographs(tmp_path, refuses):
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\nrubbish")
    refuses(DataError, r"cannot identify image file\)", read_photograph, tmp_path / "a.png")
    clear = np.dstack([PIXELS, np.zeros((12, 20), np.uint8)])
    with pytest.raises(DataError, match="100 % of its pixels are transparent"):
        read_photograph(by_pillow(tmp_path / "b.png", clear))


def test_a_strip_follows_its_line(tmp_path, refuses):
    row, column = np.mgrid[:30, :40]
    gradient = np.stack([6 * column, 8 * row, 0 * row], axis=-1).astype(np.uint8)
    photograph = read_photograph(by_pillow(tmp_path / "a.png", gradient))
    along = strip(photograph, "5,20,35,20")
    np.testing.assert_allclose(along.position, np.arange(31.0))
    np.testing.assert_allclose(along.pixels.mean(axis=1)[:, 0] * 255, 6 * np.arange(5, 36), atol=1e-3)
    np.testing.assert_allclose(sorted(along.pixels[0, :, 1] * 255), 8 * np.arange(18, 23), atol=1e-3)
    slanted = strip(photograph, [0, 0, 30, 29])
    mean = slanted.pixels.mean(axis=1) * 255
    fraction = slanted.position / slanted.position[-1]
    middle = slice(4, -4)  # the ends are cut by the edges of the photograph
    np.testing.assert_allclose(mean[middle, 0], 180 * fraction[middle], atol=6)
    np.testing.assert_allclose(mean[middle, 1], 232 * fraction[middle], atol=8)
    for wrong in ("5,5,5,5", "0,0,40,0", "1,2,3"):
        refuses(UsageError, "strip", strip, photograph, wrong)
