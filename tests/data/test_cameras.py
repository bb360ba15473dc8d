"""Cameras and lamps: tables of any layout, and a matrix from a chart against the spread of many."""

import numpy as np
import pytest

from pellicle.data.cameras import fit_matrix, read_chart, read_lamp, read_sensitivities
from pellicle.errors import DataError
from tests.data.tables import rows

NM = [500.0, 600.0, 700.0]
BANDS = np.array([[0.1, 0.8, 0.4], [0.9, 0.3, 0.0], [0.2, 0.0, 0.05]])


@pytest.mark.parametrize(
    "text",
    [
        "wavelength_nm,R,G,B\n" + rows(NM, *BANDS.T),
        "# a camera\nB;wavelength_um;G;R\n"
        + rows(BANDS[:, 2], np.divide(NM, 1000), *BANDS.T[[1, 0]], mark=";"),
        "wavelength,red,green,blue\n" + rows(NM[::-1], *BANDS[::-1].T),
        "lambda,L,M,S\n" + rows(NM, *BANDS.T),
        rows(NM, *BANDS.T),
    ],
)
def test_sensitivities_of_any_layout(write, text):
    nm, seen = read_sensitivities(write(text))
    np.testing.assert_allclose(nm, NM)
    np.testing.assert_allclose(seen, BANDS)


def test_a_lamp_in_energies_rises_in_wavelength(write):
    nm, power = read_lamp(write("energy_eV,power\n2.0,3.0\n2.5,1.0\n"))
    np.testing.assert_allclose(nm, [1239.841984 / 2.5, 1239.841984 / 2], rtol=1e-9)
    assert power.tolist() == [1.0, 3.0]


@pytest.mark.parametrize(
    ("read", "text", "reasons"),
    [
        (read_sensitivities, "wavelength_nm,R,G\n500,1,2\n600,1,2\n", ("2 columns beside",)),
        (read_sensitivities, "angle,R,G,B\n5,1,2,3\n6,1,2,3\n", ("0 wavelength columns",)),
        (read_sensitivities, "wavelength_nm,R,G,B\n500,1,2,3\n600,1,,3\n", ("line 3", "empty")),
        (read_sensitivities, "wavelength_nm,R,G,B\n500,1,2,3\n600,1,-2,3\n", ("line 3", "below zero")),
        (read_sensitivities, "wavelength_nm,R,G,B\n500,1,0,3\n600,1,0,3\n", ("'G' is nowhere above zero",)),
        (read_lamp, "wavelength_nm,power\n500,1\n500,2\n600,1\n", ("repeats",)),
        (read_lamp, "wavelength_nm,power\n500,1\n", ("two or more wavelengths",)),
        (read_lamp, "wavelength_nm,a lamp,another\n500,1,2\n600,1,2\n", ("one lamp",)),
        (read_lamp, "wavelength,power\n0.5,1\n0.6,1\n", ("unlike nm; name the unit", "wavelength_um")),
        (read_lamp, "", ("is empty",)),
        (read_lamp, "\x89PNG\r\n", ("without any row",)),
    ],
)
def test_damage_is_refused(write, refusal, read, text, reasons):
    refusal(read, write(text), DataError, *reasons)


TRUTH = np.array([[2.1, -0.7, -0.3], [-0.5, 1.6, -0.1], [0.1, -0.4, 1.4]])
XYZ = np.random.default_rng(1).uniform(0.05, 0.9, (24, 3))


def test_a_chart_in_percent_and_8_bits(tmp_path):
    rgb = XYZ @ (0.5 * np.eye(3)) + 0.02
    table = np.column_stack([np.round(255 * rgb), 100 * XYZ])
    path = tmp_path / "chart.csv"
    body = "".join(f"patch {i}," + ",".join(f"{x:.10g}" for x in row) + "\n" for i, row in enumerate(table))
    path.write_text("name,R,G,B,X,Y,Z\n" + body)
    chart = read_chart(path)
    np.testing.assert_allclose(chart.rgb, rgb, atol=0.5 / 255 + 1e-9)
    np.testing.assert_allclose(chart.xyz, XYZ, atol=1e-9)
    assert "8-bit" in chart.notes[0]
    assert "percent" in chart.notes[1]


@pytest.mark.parametrize("given", [True, False])
def test_the_covariance_is_the_spread_of_many_fits(given):
    rng = np.random.default_rng(0)
    sigma = np.full(XYZ.shape, [0.01, 0.02, 0.005])
    fits = [
        fit_matrix(XYZ @ TRUTH.T + sigma * rng.normal(size=XYZ.shape), XYZ, sigma if given else None)
        for _ in range(400)
    ]
    matrices = np.array([fit.matrix.ravel() for fit in fits])
    stated = np.mean([np.diag(fit.covariance) for fit in fits], axis=0)
    if given:  # the larger of σ and the residuals: 0.5 · E|χ²/21 − 1| = 12 % more
        stated = stated / 1.12
    np.testing.assert_allclose(np.var(matrices, axis=0), stated, rtol=0.2)  # 400 draws: 7 % (1 σ)
    np.testing.assert_allclose(matrices.mean(axis=0), TRUTH.ravel(), atol=0.01)
    correlation = np.corrcoef(matrices.T)[0, 1]
    one = fits[0].covariance
    assert one[0, 1] / np.sqrt(one[0, 0] * one[1, 1]) == pytest.approx(correlation, abs=0.15)


def test_charts_that_give_no_matrix(write, refusal, refuses):
    path = write("R,G,B\n1,2,3\n", "chart.csv")
    refusal(read_chart, path, DataError, "X, Y, Z of the reference")
    path.write_text("R,G,B,X,Y,Z\n" + ".1,.1,.1,.1,.1,.1\n" * 5)
    refusal(read_chart, path, DataError, "5 patches")
    grey = np.outer(np.linspace(0.1, 0.9, 8), [0.95, 1.0, 1.09])
    refuses(DataError, "one hue", fit_matrix, grey, grey, None)
    coloured = np.random.default_rng(2).uniform(0.1, 0.9, (8, 3))
    with pytest.raises(DataError, match="one hue"):
        fit_matrix(coloured @ np.ones((3, 3)) / 3, coloured, None)  # a grey photograph of the chart
