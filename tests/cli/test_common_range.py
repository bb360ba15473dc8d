"""Points beyond the data of media: left out and said, or refused with the common range."""

import numpy as np
import pytest

from pellicle.cli.reading import read
from pellicle.data.options import FileOptions
from pellicle.errors import DataError
from pellicle.materials import ROUNDING, check_common_range, material
from pellicle.reporting.json_record import left_out
from pellicle.scene.film import Scene
from pellicle.scene.layers import Layer

SCENE = Scene(Layer("SU-8", 500.0), "Si")  # known from 320 to 1450 nm together


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


def test_all_points_stay_with_a_range_or_without_a_scene(spectrum):
    path = spectrum(250, 1000)
    assert read(path, FileOptions(range=(250.0, 1000.0)), SCENE)[0].wavelength[0] == 250
    assert read(path, FileOptions())[0].left_out is None


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
