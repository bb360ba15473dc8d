"""Parts of the benchmarks that a wrong number would not reveal. No other package is needed."""

import importlib
import json
import math
import os
import runpy
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

from .by_tmm import films, ncs, psi_delta

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


def test_film_of_the_other_programs_agrees_with_tmm(benchmark):
    """Pellicle's Δ is minus the phase of tmm's time convention."""
    film = benchmark("whole_fits.numpy_film")
    indices, depths = zip(*LAYERS, strict=True)
    stack = NM, [1.0, *indices, SILICON], depths
    np.testing.assert_allclose(film.reflectance(NM, LAYERS, SILICON), films("s", *stack), rtol=1e-12)
    psi, delta = film.psi_delta(NM, LAYERS, SILICON, np.full(5, 65.0))
    for found, truth in zip((psi, delta), psi_delta(*ncs(*stack, 65.0).T), strict=True):
        np.testing.assert_allclose(np.mod(found, 360), truth, rtol=1e-11)


def test_film_of_the_other_programs_on_a_plate_agrees_with_tmm(benchmark):
    film = benchmark("whole_fits.numpy_film")
    plate, absorbing = np.full(5, 1.52), [(LAYERS[0][0] + 0.05j, 200.0), LAYERS[1]]
    indices = [1.0, *(n for n, _ in absorbing), 1.52, 1.0]
    expected = films("s", NM, indices, [200.0, 7.0, 1e6], kind="T", coherence="iccii")
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


def test_reference_of_stacks_on_a_gpu_agrees_with_tmm(benchmark):
    gpu = benchmark("gpu")
    depths = np.array([[50.0, 120.0], [80.0, 40.0], [110.0, 70.0]])
    indices = [1.0, gpu.PAIR[0], gpu.PAIR[1], gpu.PAIR[0], gpu.SUBSTRATE]
    expected = [films("s", gpu.WAVELENGTH, indices, column, angle=45.0) for column in depths.T]
    np.testing.assert_allclose(gpu._by_numpy(depths), expected, rtol=1e-11)


def test_device_that_is_absent_ends_with_code_2(benchmark, capsys):
    if any(device.platform == "gpu" for device in jax.devices()):
        pytest.skip("this machine has a GPU")
    with pytest.raises(SystemExit) as stopped:
        benchmark("device").chosen("gpu")
    assert stopped.value.code == 2
    assert "no GPU on this machine, only cpu" in capsys.readouterr().err


PEERS = Path(__file__).parents[1] / "benchmarks" / "peers"
PEER_MODULES = (
    *("cases", "truth", "table", "packages", "birefringent", "dispersion", "graded"),
    *("adapters.pellicle_any", "adapters.dispersion_pellicle"),
)


@pytest.fixture(scope="module")
def peers(modules_of):
    """Modules of the script, which belong to no package."""
    with modules_of(PEERS, *PEER_MODULES) as modules:
        yield modules


@pytest.mark.slow  # computes for 3 s
def test_reference_values_agree_with_pellicle(peers):
    """Two programs and two formulas; at a critical substrate the square root amplifies rounding."""
    cases, ours, table = peers["cases"], peers["adapters.pellicle_any"], peers["table"]
    for name, case in cases.CASES.items():
        smooth = name not in cases.WITHOUT_SLOPE
        truth = peers["truth"].truth(case, slopes=smooth)
        assert table.error(ours.values(case, np.float64), truth["values"], "values") < (
            1e-12 if smooth else 5e-7
        ), name
        if smooth:
            assert table.error(ours.slopes(case, np.float64), truth["slopes"], "slopes") < 1e-9, name


@pytest.mark.parametrize("name", ["films", "birefringent", "dispersion", "graded"])
def test_tables_are_inserted_into_the_page(peers, name):
    script = runpy.run_path(str(PEERS / "__main__.py"), run_name="peers")
    page, (begin, end) = script["PAGE"].read_text("utf-8"), (script[x].format(name) for x in ("BEGIN", "END"))
    again = script["inserted"](page, "new tables", name)
    before, _, rest = page.partition(begin)
    assert again == before + begin + "\n\nnew tables\n\n" + rest[rest.index(end) :]


def test_every_package_has_an_adapter(peers):
    packages = peers["packages"]
    others = (*peers["birefringent"].PACKAGES, *peers["dispersion"].PACKAGES)
    adapters = {path.stem for path in (PEERS / "adapters").glob("*.py")}
    assert {p.adapter for p in (*packages.OURS, *packages.PEERS, *others)} <= adapters
    assert all(p.install for p in packages.PEERS)


def test_permittivities_with_50_digits_agree_with_pellicle(peers):
    cases, truths = peers["dispersion"].cases_and_truths()
    for name, case in cases.items():
        found = peers["adapters.dispersion_pellicle"].values(case)
        assert peers["table"].error(found, truths[name]["values"], "values") < 1e-12, name
    assert [len(case["packages"]) for case in cases.values()] == [2] * len(cases)


def test_errors_and_cells(peers):
    table = peers["table"]
    truth = {"values": {"Rs": [0.5], "Rp": [0.25]}}
    assert table.error({"Rp": [0.25], "Rs": [0.4]}, truth["values"], "values") == pytest.approx(0.1)
    assert table.error({"Rs": [1.0]}, {"Rs": [0.5]}, "slopes") == pytest.approx(0.5 / 0.501)
    assert math.isnan(table.error({"Rs": [math.nan]}, truth["values"], "values"))

    def cell(answer):
        return table.cell(answer, truth, "values")

    assert cell({"values": {"Rs": [0.5]}}) == "0"
    assert cell({"values": {"Rs": [0.5 + 1e-4]}, "warnings": ["beware"]}) == "1e-04†"
    assert cell({"values": {"Rs": [0.51]}}) == "**1e-02**"
    assert cell({"values": {"Rs": [math.nan]}}) == "**nan**"
    assert cell({"values": "hang"}) == "**hang**"
    assert cell({"values": "ValueError: no such thing"}) == "**refuses**"
    assert cell({}) == ""


def test_graded_films_in_homogeneous_slices(peers, monkeypatch):
    """Of second order in their thickness; tmm is among the tools of the tests."""
    graded = peers["graded"]
    monkeypatch.setattr(graded, "SLICES", (8, 16))
    table = json.loads(graded.TABLE.read_text("utf-8"))
    name = "linear on silicon"
    rows = {name: table["rows"][name]}
    monkeypatch.setattr(graded, "truths", lambda: {name: np.array(rows[name]["values"][:4], dtype=float)})
    package = next(x for x in graded.PACKAGES if x.adapter == "tmm")
    coarse, fine = graded.theirs(rows, table["nm"], package, Path(sys.executable))
    assert np.log2(coarse.errors / fine.errors) == pytest.approx(2, abs=0.3)
    assert min(coarse.microseconds, fine.microseconds) > 0
