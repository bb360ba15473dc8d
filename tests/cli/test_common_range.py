"""Points beyond the data of media: left out and said, or refused with the common range."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.api import fits
from pellicle.cli.reading import read
from pellicle.data.options import FileOptions
from pellicle.errors import DataError
from pellicle.fitting.comparison import Comparison
from pellicle.fitting.curves import Curve
from pellicle.fitting.result import Part
from pellicle.materials import ROUNDING, check_common_range, material
from pellicle.reporting.json_record import left_out
from pellicle.scene.film import Scene
from pellicle.scene.free import Free
from pellicle.scene.layers import Layer
from tests.made_fits import made_fit

SCENE = Scene(Layer("SU-8", Free(450, 550)), "Si")  # known from 320 to 1450 nm together


@pytest.fixture
def spectrum(tmp_path):
    def written(low, high):
        nm = np.arange(low, high + 1, 5.0)
        path = tmp_path / f"{low}.csv"
        np.savetxt(
            path, np.c_[nm, 0.3 + 0.1 * np.cos(nm / 60)], "%.5f", ",", header="wavelength_nm,R", comments=""
        )
        return str(path)

    return written


def test_points_beyond_the_media_are_left_out_and_said(spectrum):
    [cut] = read(spectrum(250, 1000), FileOptions(), SCENE)
    assert (cut.wavelength[0], cut.wavelength[-1]) == (320, 1000)
    assert "all media are known from 320 to 1450 nm (SU-8 320 to 1700 nm)" in cut.notes[-1]
    assert left_out(cut)["left_out"] == {"points": 14, "reason": "beyond the data of a medium"}
    np.testing.assert_array_equal(cut.left_out.wavelength, np.arange(250, 320, 5))


def test_points_within_a_range_that_media_do_not_cover(spectrum):
    path = spectrum(250, 1000)
    assert read(path, FileOptions(range=(250.0, 900.0)), SCENE)[0].wavelength[0] == 320
    assert read(path, FileOptions())[0].left_out is None


def test_fits_in_python_leave_them_out_and_say_it(monkeypatch, spectrum):
    """A joint fit of two samples, and a comparison, which is of what all scenes cover."""
    seen = []

    def told(data, *_, **__):
        seen.append(data)
        curve, [first, *_] = Curve(*[np.ones(1)] * 8), data if isinstance(data, list) else [data]
        return made_fit(Part("", first, curve, pl.plan(SCENE), 0.0, 1.0, 9.0), warnings=("own",))

    monkeypatch.setattr(fits, "fit_spectra", told)
    whole, other = pl.read_spectrum(spectrum(250, 1000)), Scene(Layer("SiO2", Free(100, 900)), "Ge")
    fit = pl.fit([whole, whole], [SCENE, other])
    assert [x.wavelength[0] for x in seen.pop()] == [320, 250]
    sentence = "137 of 151 points kept, 320 to 1000 nm: all media are known from 320 to 1450 nm"
    assert fit.warnings[0].startswith(sentence)
    assert fit.warnings[1:] == ("own",)

    monkeypatch.setattr(
        fits,
        "best_explained",
        lambda names, of: Comparison((), float(len([of(name, False) for name in names]))),
    )
    pl.compare(whole, {"oxide": other, "polymer": SCENE})
    assert [x.wavelength[0] for x in seen] == [320, 320]


def test_less_than_half_is_not_cut_but_refused(spectrum):
    [whole] = read(spectrum(210, 400), FileOptions(), SCENE)
    assert len(whole) == 39
    sentence = r"all media are known from 320 to 1450 nm \(SU-8 320 to 1700 nm, Si .*`range=\(320, 400\)`"
    with pytest.raises(DataError, match=sentence):
        check_common_range(SCENE, whole.wavelength)


def test_the_end_of_a_range_may_be_rounded():
    """1240/E for 1239.84/E, or two digits: 0.03 nm."""
    silicon = material("Si")
    assert complex(silicon(250 - 0.9 * ROUNDING)) == complex(silicon(250.0))
    assert np.isnan(complex(silicon(250 - 1.1 * ROUNDING)))
    check_common_range(SCENE, [320 - 0.9 * ROUNDING, 1450 + 0.9 * ROUNDING])
