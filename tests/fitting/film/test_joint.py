"""Several spectra of one sample, fitted together."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

import pellicle as pl
from pellicle.dispersion.empirical import CauchyUrbach
from pellicle.errors import UsageError
from pellicle.fitting.evaluation import deviances, total_deviance
from pellicle.fitting.film.fit import labels, measurements
from pellicle.fitting.film.problem import make, measured
from pellicle.reporting.figures import draw_fit as draw
from pellicle.reporting.fit_text import report
from pellicle.reporting.json_record import to_json

from ... import by_tmm

WAVELENGTH = np.linspace(400.0, 900.0, 60)
GLASS = 1.52
SIZE = np.array([100.0, 1.0, 1e4, 1.0, 1.0])
"""What thickness, A, B and the scales of R and T are measured in."""
TRUTH = np.array([150.0, 2.0, 2e4, 1.1, 0.9])
NOISE = {"R": 0.002, "T": 0.001, "psi": 0.05, "delta": 0.1}
FREE = (pl.Free(20, 600), pl.Free(1.6, 2.6), pl.Free(0, 5e4))


def films(thickness, a, b, scale_r, scale_t) -> dict[str, np.ndarray]:
    """Scaled R and T at 0°, Ψ and Δ at 70°, of a Cauchy film on glass."""
    stack = WAVELENGTH, [1, a + b / WAVELENGTH**2, GLASS], [thickness]
    psi, delta = by_tmm.psi_delta(*by_tmm.ncs(*stack, 70.0).T)
    R, T = (scale * by_tmm.films("s", *stack, kind=kind) for scale, kind in ((scale_r, "R"), (scale_t, "T")))
    return {"R": R, "T": T, "psi": psi, "delta": delta}


@pytest.fixture(scope="module")
def spectra() -> list[pl.Spectrum]:
    """R and T of unknown scales, and Ψ and Δ, of one film, each with its own noise."""
    rng = np.random.default_rng(1)
    clean = films(*TRUTH)
    seen = {name: clean[name] + rng.normal(0, sd, 60) for name, sd in NOISE.items()}
    sigma = {name: np.full(60, sd) for name, sd in NOISE.items()}
    light = [pl.Spectrum(WAVELENGTH, seen[x], x, sigma=sigma[x], path=f"film_{x}.csv") for x in "RT"]
    both = {"delta": seen["delta"] % 360, "delta_sigma": sigma["delta"], "angle": np.full(60, 70.0)}
    angles = pl.Spectrum(WAVELENGTH, seen["psi"], "psi-delta", sigma["psi"], path="angles.csv", **both)
    return [*light, angles]


@pytest.fixture(scope="module")
def together(spectra) -> pl.Fit:
    layer = pl.Layer(pl.dispersion.Cauchy(FREE[1], FREE[2]), FREE[0])
    return pl.fit(spectra, pl.Scene(layer, GLASS, instrument=pl.Instrument(scale="free")))


@pytest.mark.slow
def test_reflectance_transmittance_and_ellipsometry_as_an_independent_fit(together, spectra):
    """The same minimum and errors as scipy's least squares of tmm's films, started at the truth."""
    angles = spectra[2]

    def residual(scaled):
        film = films(*(scaled * SIZE))
        missed = [(s.values - film[s.signal]) / s.sigma for s in spectra[:2]]
        missed.append((angles.values - film["psi"]) / angles.sigma)
        turned = (angles.delta - film["delta"] + 180.0) % 360.0 - 180.0
        return np.concatenate([*missed, turned / angles.delta_sigma])

    found = least_squares(residual, TRUTH / SIZE, xtol=1e-12, ftol=1e-12)
    stderr = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac))) * SIZE
    assert together.status == "converged"
    scales = ["instrument.scale.film_R", "instrument.scale.film_T"]
    assert [p.name for p in together.free] == ["thickness", "A", "B", *scales]
    for estimate, value, error, truth in zip(together.free, found.x * SIZE, stderr, TRUTH, strict=True):
        # on the sphere an error of Δ is a chord, and each measured point's own sin 2Ψ is its weight
        assert abs(estimate.value - value) < 3e-2 * error
        assert estimate.stderr_noise == pytest.approx(error, rel=1e-2)
        assert abs(estimate.value - truth) < 4 * error
    # Ψ and Δ of 60 points are 120 numbers; the sphere's curvature shows in the fourth digit
    assert together.chi2_reduced == pytest.approx(2 * found.cost / (240 - 5), rel=1e-3)


@pytest.mark.slow
def test_a_part_for_each_spectrum(together, spectra):
    assert [part.name for part in together.parts] == ["film_R", "film_T", "angles"]
    for part, spectrum in zip(together.parts, spectra, strict=True):
        assert part.plan.signal == spectrum.signal
        if spectrum is not spectra[2]:
            assert part.rms == pytest.approx(np.sqrt(np.mean((spectrum.values - part.curve.model) ** 2)))
    assert together.rms is None  # fractions and degrees have none in common
    with pytest.raises(ValueError, match="joint fit of 3 "):
        together.curve  # noqa: B018


OXIDE = pl.Scene(pl.Layer("SiO2", pl.Free(10, 400)), "Si")


def oxide(thickness: float = 100.0) -> pl.Spectrum:
    values = np.asarray(pl.reflectance(WAVELENGTH, thickness, "SiO2", "Si"))
    noise = np.random.default_rng(2).normal(0, 0.002, 60)
    return pl.Spectrum(WAVELENGTH, values + noise, "R", sigma=np.full(60, 0.002), path=f"{thickness:g}nm.csv")


def test_a_list_of_one_is_the_spectrum_with_a_name():
    one, listed = pl.fit(oxide(), OXIDE), pl.fit([oxide()], OXIDE)
    assert (one.joint, listed.joint) == (False, True)
    assert listed.parts[0].name == "100nm"
    assert listed["thickness"] == one["thickness"]


def test_of_one_scene_ellipsometry_leaves_out_the_scale(spectra, refuses):
    """And alone it is refused: a scale was asked for that it cannot have."""
    scene = pl.Scene(OXIDE.layers, "Si", instrument=pl.Instrument(scale="free", offset=0.01, bandwidth=2.0))
    found = measurements(spectra, scene)
    scaled = [(m.scene.instrument.scale, m.scene.instrument.offset) for m in found]
    assert scaled == [(scene.instrument.scale, 0.01)] * 2 + [(1.0, 0.0)]
    assert [m.scene.instrument.bandwidth for m in found] == [2.0] * 3
    refuses(UsageError, "no scale and no offset", pl.fit, spectra[2], scene)


@pytest.mark.slow
def test_a_spectrum_of_another_sample_is_a_misfit_that_names_the_file():
    """Without σ, too: its noise would grow with its residuals until it counts for nothing."""
    right, wrong = oxide(100.0), replace(oxide(130.0), sigma=np.full(60, 0.02))
    found, without = (
        pl.fit(x, OXIDE) for x in ([right, wrong], [replace(s, sigma=None) for s in (right, wrong)])
    )
    assert found.status == without.status == "misfit"
    assert found.parts[1].name in found.verdict
    assert found.parts[0].name not in found.verdict


def test_layers_are_shared_and_the_instrument_is_each_spectrums_own():
    """A prior of what is shared counts once."""
    width = pl.Free(0, 20, prior=pl.priors.Normal(5.0, 1.0))
    thickness = pl.Free(10, 400, prior=pl.priors.Normal(100.0, 2.0))
    scene = pl.Scene(pl.Layer(1.46, thickness), "Si", instrument=pl.Instrument(bandwidth=width))
    problem = make(*(measured(oxide(), scene, name) for name in "ab"))
    names = [p.name for p in problem.parameters]
    assert names == ["thickness", "instrument.bandwidth.a", "instrument.bandwidth.b"]
    assert [view.takes for view in problem.views] == [(0, 1), (0, 2)]
    assert problem.box.prior_weight.tolist() == [0.5, 1.0, 1.0]
    values, box = np.array([[105.0, 4.0, 8.0]]), problem.box
    own = sum(deviances(x.form, x.arrays, problem.seen_by(x, values)).value[0] for x in problem.views)
    [together] = total_deviance(problem, (values - box.lower) / (box.upper - box.lower))
    assert together - own == pytest.approx(2.5**2 + 1.0**2 + 3.0**2, rel=1e-9)


def test_what_tells_spectra_apart():
    r = pl.Spectrum(WAVELENGTH, np.full(60, 0.1), "R", path="a/film.v2.csv")
    t = replace(r, signal="T")
    assert labels([r]) == ["film_v2"]
    assert labels([r, replace(t, path="b.csv")]) == ["film_v2", "b"]
    assert labels([r, t]) == ["film_v2-R", "film_v2-T"]
    assert labels([r, r]) == ["film_v2-1", "film_v2-2"]
    assert labels([replace(r, path=""), replace(t, path="")]) == ["R", "T"]
    assert "thickness" not in labels([r, replace(t, path="thickness.csv")])


@pytest.mark.parametrize(
    ("spectra", "scenes", "said"),
    [
        ([], OXIDE, "no spectrum"),
        ([oxide(), oxide()], [OXIDE], "2 spectra need as many scenes"),
        ([oxide(), oxide()], [OXIDE, pl.Scene(pl.Layer("SiO2", 1.0), "Si")], "same layers"),
        ([oxide(), oxide()], [OXIDE, pl.Scene(OXIDE.layers, "BK7")], "of several samples `shared` names"),
    ],
)
def test_what_is_no_joint_fit(spectra, scenes, said, refuses):
    refuses(UsageError, said, pl.fit, spectra, scenes)


@pytest.mark.slow
def test_an_absorbing_film_on_a_plate_from_both_its_faces():
    """R and T of what a user has: an absorbing film on a glass plate, against tmm's incoherent plate."""
    rng, energy = np.random.default_rng(1), 1239.841984 / WAVELENGTH
    index = 2.0 + 2e4 / WAVELENGTH**2 + 0.1j * np.exp((energy - 2.5) / 0.3)
    plate = WAVELENGTH, [1, index, GLASS, 1], [150.0, 1e6]
    measured = []
    for x in "RT":
        values = by_tmm.films("s", *plate, kind=x, coherence="icii") + rng.normal(0, NOISE[x], 60)
        measured.append(pl.Spectrum(WAVELENGTH, values, x, sigma=np.full(60, NOISE[x]), path=f"{x}.csv"))
    k0, width = pl.Free(0, 1), pl.Free(0.1, 1)
    film = CauchyUrbach(FREE[1], FREE[2], 0.0, k0, width, 2.5)
    found = pl.fit(measured, pl.Scene(pl.Layer(film, FREE[0]), pl.Substrate(GLASS, "air")))
    assert found.status == "converged"
    assert "The back face matters" in found.verdict
    for name, truth in (("thickness", 150.0), ("A", 2.0), ("B", 2e4), ("k0", 0.1), ("Eu", 0.3)):
        assert abs(found[name].value - truth) < 4 * found[name].stderr


@pytest.fixture(scope="module")
def polarised() -> str:
    """Ψ, Δ, R_p and R_s at 70° of one film in one table, as ellipsometers with a photometer write it."""
    rng, clean = np.random.default_rng(3), films(150.0, 2.0, 2e4, 1.0, 1.0)
    stack = WAVELENGTH, [1, 2.0 + 2e4 / WAVELENGTH**2, GLASS], [150.0], 70.0
    p, s = (by_tmm.films(x, *stack) + rng.normal(0, 0.002, 60) for x in "ps")
    psi, delta = clean["psi"] + rng.normal(0, 0.05, 60), (clean["delta"] + rng.normal(0, 0.1, 60)) % 360
    columns = zip(WAVELENGTH, np.full(60, 70.0), psi, delta, p, s, strict=True)
    rows = [",".join(f"{x:.10g}" for x in row) for row in columns]
    return "wavelength_nm,angle_deg,psi_deg,delta_deg,Rp,Rs\n" + "\n".join(rows) + "\n"


@pytest.mark.slow  # a joint fit of a scene of its own
def test_ellipsometry_with_both_polarised_reflectances(polarised, write):
    """One scene for all: each spectrum brings its signal and its polarisation."""
    spectra = pl.read_spectra(write(polarised))
    lights = [("psi-delta", "unpolarised"), ("R", "p"), ("R", "s")]
    assert [s.name for s in spectra] == ["psi-delta", "Rp", "Rs"]
    assert [(s.signal, s.polarisation) for s in spectra] == lights
    layer = pl.Layer(pl.dispersion.Cauchy(FREE[1], FREE[2]), FREE[0])
    fit = pl.fit(spectra, pl.Scene(layer, GLASS))
    assert fit.status == "converged"
    for name, truth in (("thickness", 150.0), ("A", 2.0), ("B", 2e4)):
        # σ comes from the residuals of each
        assert abs(fit[name].value - truth) < 4 * fit[name].stderr_noise
    assert [part.name for part in fit.parts] == ["film-psi-delta", "film-Rp", "film-Rs"]
    assert [(part.plan.signal, part.plan.polarisation) for part in fit.parts] == lights
    for part in fit.parts[1:]:
        assert part.rms == pytest.approx(0.002, rel=0.3)
    names, text, figure = [s.name for s in spectra], " ".join(report(fit).split()), draw(fit)
    assert [f"film.csv [{name}]" in text for name in names] == [True] * 3
    assert [one["spectrum"] for one in to_json(fit)["data"]] == names
    assert "film.csv [psi-delta, Rp, Rs]: converged" in figure.get_suptitle()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert [title for title in titles if title] == [f"film-{name}" for name in names]
