"""Parts of the benchmarks that a wrong number would not reveal: the film of the others, the flag --device."""

import importlib
import os
from pathlib import Path

import jax
import numpy as np
import pytest
import tmm

HERE = Path(__file__).parents[1] / "benchmarks"
NM = np.linspace(400.0, 900.0, 5)
SILICON = np.linspace(5.6, 3.6, 5) + 1j * np.linspace(0.4, 0.01, 5)
LAYERS = [(1.9 + 4000 / NM**2, 200.0), (np.full(5, 1.46 + 0.02j), 7.0)]


@pytest.fixture(scope="module")
def benchmark(modules_of):
    """Return a function that imports a module of the benchmarks; what these set is restored."""
    double = jax.config.read("jax_enable_x64")
    with pytest.MonkeyPatch.context() as patch, modules_of(HERE):
        for name in ("XLA_FLAGS", "OMP_NUM_THREADS"):
            patch.setenv(name, os.environ.get(name, ""))
        yield importlib.import_module
    jax.config.update("jax_enable_x64", double)


def _by_tmm(polarisation: str, angle: float, i: int, layers=LAYERS, substrate=SILICON) -> dict:
    indices = [1.0, *(n[i] for n, _ in layers), substrate[i]]
    depths = [np.inf, *(d for _, d in layers), np.inf]
    return tmm.coh_tmm(polarisation, indices, depths, np.deg2rad(angle), NM[i])


def test_film_of_the_other_programs_agrees_with_tmm(benchmark):
    """Pellicle's Δ is minus the phase of tmm's time convention."""
    film = benchmark("whole_fits.numpy_film")
    R = [_by_tmm("s", 0.0, i)["R"] for i in range(5)]
    np.testing.assert_allclose(film.reflectance(NM, LAYERS, SILICON), R, rtol=1e-12)
    ratio = np.array([_by_tmm("p", 65.0, i)["r"] / _by_tmm("s", 65.0, i)["r"] for i in range(5)])
    psi, delta = film.psi_delta(NM, LAYERS, SILICON, np.full(5, 65.0))
    np.testing.assert_allclose(np.tan(np.deg2rad(psi)), np.abs(ratio), rtol=1e-12)
    np.testing.assert_allclose(np.exp(-1j * np.deg2rad(delta)), ratio / np.abs(ratio), rtol=1e-12)


def test_film_of_the_other_programs_on_a_plate_agrees_with_tmm(benchmark):
    film = benchmark("whole_fits.numpy_film")
    plate, absorbing = np.full(5, 1.52), [(LAYERS[0][0] + 0.05j, 200.0), LAYERS[1]]
    expected = [
        tmm.inc_tmm(
            *("s", [1.0, absorbing[0][0][i], absorbing[1][0][i], 1.52, 1.0]),
            *([np.inf, 200.0, 7.0, 1e6, np.inf], ["i", "c", "c", "i", "i"], 0.0, NM[i]),
        )["T"]
        for i in range(5)
    ]
    np.testing.assert_allclose(film.plate_transmittance(NM, absorbing, plate), expected, rtol=1e-12)


def test_scan_of_the_other_programs_starts_beside_the_truth(benchmark):
    """The χ² of the truth is that of the noise, and a scan leads to it."""
    cases, problem = benchmark("whole_fits.cases"), benchmark("whole_fits.problem")
    case = cases.cases()[1]
    one = problem.Problem(case, cases.measurement(case, 0))
    rows = one.residuals(one.truth[None])[0]
    assert abs(np.sum(rows**2) - rows.size) < 5 * np.sqrt(2 * rows.size)
    axis = case.thickness_axis
    nearest = np.min(np.abs(one.starts(4)[:, axis] - one.truth[axis])) * one.width[axis]
    assert nearest < 40  # nm; neighbouring minima are 140 nm or more apart


def test_device_that_is_absent_ends_with_code_2(benchmark, capsys):
    if any(device.platform == "gpu" for device in jax.devices()):
        pytest.skip("this machine has a GPU")
    with pytest.raises(SystemExit) as stopped:
        benchmark("device").chosen("gpu")
    assert stopped.value.code == 2
    assert "no GPU on this machine, only cpu" in capsys.readouterr().err


@pytest.mark.slow
def test_device_table_shows_rate_limit_and_error(benchmark, capsys, monkeypatch):
    before = jax.config.jax_default_device
    film = benchmark("film")
    try:
        device = benchmark("device").chosen("cpu")
        assert jax.config.jax_default_device == device
        monkeypatch.setattr(film.on_device, "COPIED_BYTES", {"cpu": 2**16})
        monkeypatch.setattr(film.on_device, "LEAST_SECONDS", 0.0)
        with jax.enable_x64(True):
            film.device_table(device, 3)
    finally:
        jax.config.update("jax_default_device", before)
    lines = capsys.readouterr().out.splitlines()[2:]
    assert [line.split(",")[0] for line in lines] == ["float32"] * 3 + ["float64"] * 3
    for line in lines:
        rate, limit, share, error = (float(word.rstrip("%")) for word in line.split()[2:])
        assert share == pytest.approx(100 * rate / limit, rel=0.02, abs=0.06)
        assert 0 < error < (2e-6 if line.startswith("float32") else 1e-14)
