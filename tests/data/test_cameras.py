"""Matrix of a camera from a chart, against a known matrix and the spread of many simulated charts."""

import numpy as np
import pytest

from pellicle.data.cameras import fit_matrix, read_chart
from pellicle.errors import DataError

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


def test_charts_that_give_no_matrix(write, refusal):
    path = write("R,G,B\n1,2,3\n", "chart.csv")
    refusal(read_chart, path, DataError, "X, Y, Z of the reference")
    path.write_text("R,G,B,X,Y,Z\n" + ".1,.1,.1,.1,.1,.1\n" * 5)
    refusal(read_chart, path, DataError, "5 patches")
    grey = np.outer(np.linspace(0.1, 0.9, 8), [0.95, 1.0, 1.09])
    with pytest.raises(DataError, match="one hue"):
        fit_matrix(grey, grey, None)
    coloured = np.random.default_rng(2).uniform(0.1, 0.9, (8, 3))
    with pytest.raises(DataError, match="one hue"):
        fit_matrix(coloured @ np.ones((3, 3)) / 3, coloured, None)  # a grey photograph of the chart
