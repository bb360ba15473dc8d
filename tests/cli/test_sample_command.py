"""`pellicle sample` and `pellicle fit --posterior`: files, JSON, exit codes, chains taken up again."""

import json
import math
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from pellicle.sampling.chain import arviz


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("posterior") / "out"


@pytest.fixture
def sampled(pellicle, spectrum_file, scene, folder):
    """The same command again and again, which samples once: afterwards its chain is there."""
    return lambda *more: pellicle("sample", spectrum_file(), *scene, "--out", folder, *more)


@pytest.mark.slow
def test_the_interval_is_that_of_least_squares(sampled):
    """One minimum, many points, a flat prior: the posterior is normal, and as wide as the covariance says."""
    ran = sampled("--json")
    assert ran.code == 0
    [found] = ran.objects
    at, estimate = found["posterior"]["parameters"]["thickness"], found["parameters"]["thickness"]
    assert found["posterior"]["trusted"] is True
    assert at["mean"] == pytest.approx(estimate["value"], abs=0.15 * estimate["stderr"])
    assert at["sd"] == pytest.approx(estimate["stderr"], rel=0.1)
    assert at["q975"] - at["q025"] == pytest.approx(2 * 1.96 * estimate["stderr"], rel=0.1)
    assert sum(mode["mass"] for mode in at["modes"]) == pytest.approx(1.0)
    checks = found["posterior"]["checks"]
    assert {"n_over_tau", "rhat", "acceptance", "minima_found", "minima_visited"} <= set(checks)


@pytest.mark.slow
def test_the_report_has_the_interval_and_the_checks(sampled):
    ran = sampled()
    assert "[[Posterior]]" in ran.out
    assert "With 95 % probability thickness lies between" in ran.out
    assert "1 of 1 minima that matter visited" in ran.out
    assert max(map(len, ran.out.splitlines())) <= 100


@pytest.mark.slow
def test_files_open_in_the_programs_they_are_for(sampled, folder):
    [found] = sampled("--json").objects
    assert json.loads((folder / "result.json").read_text())["posterior"] == found["posterior"]
    data = arviz().from_netcdf(str(folder / "posterior.nc"))
    assert data.posterior["thickness"].shape[0] == found["posterior"]["checks"]["walkers"]
    mean = found["posterior"]["parameters"]["thickness"]["mean"]
    assert float(data.posterior["thickness"].mean()) == pytest.approx(mean)
    repeated, measured = data.posterior_predictive["R"], data.observed_data["R"]
    low, high = np.quantile(repeated[0], [0.025, 0.975], axis=0)
    assert 0.88 <= float(np.mean((measured >= low) & (measured <= high))) <= 1.0
    assert data.attrs["data_sha256"] == sha256(Path(found["data"]["path"]).read_bytes()).hexdigest()
    assert data.attrs["pellicle_version"] == version("pellicle")
    assert "upper=800" in data.attrs["scene"]
    assert datetime.fromisoformat(data.attrs["date"]) > datetime.now(UTC) - timedelta(hours=1)
    for name in ("corner.png", "predictive.png", "figure.png"):
        assert np.ptp(imread(folder / name)[..., :3]) > 0.5


def test_a_chain_that_is_too_short_exits_5_without_an_interval(pellicle, spectrum_file, scene):
    [found] = pellicle("sample", spectrum_file(), *scene, "--steps", "20", "--json", code=5).objects
    assert found["posterior"]["trusted"] is False
    at = found["posterior"]["parameters"]["thickness"]
    assert [at[name] for name in ("mean", "sd", "q025", "q50", "q975")] == [None] * 5
    assert math.isfinite(found["posterior"]["checks"]["n_over_tau"])
    assert found["status"] == "converged"


@pytest.mark.slow  # a chain of its own
def test_fit_samples_on_demand(pellicle, spectrum_file, scene):
    ran = pellicle("fit", spectrum_file(), *scene, "--posterior", "--json", code=0)
    assert ran.objects[0]["posterior"]["trusted"] is True


@pytest.mark.parametrize(
    ("flags", "code", "words"),
    [
        (("--walkers", "7"), 2, "--walkers must be an even number"),
        (("--walkers", "1000000000"), 3, "GiB and the machine has"),
        (("--steps", "1"), 2, "--steps must be at least 10"),
        (("--seed", "-1"), 2, "--seed must lie in"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(pellicle, spectrum_file, scene, flags, code, words):
    pellicle("sample", spectrum_file(), *scene, *flags).refused(code, words)


@pytest.mark.slow
def test_a_chain_of_another_problem_is_left_alone(sampled, pellicle, spectrum_file, scene, folder):
    sampled()
    before = (folder / "chain.h5").read_bytes()
    other = pellicle("sample", spectrum_file(seed=5), *scene, "--out", folder)
    other.refused(3, "is the chain of another problem")
    assert (folder / "chain.h5").read_bytes() == before
