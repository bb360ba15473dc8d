# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Real measurements, end to end
#
# This notebook goes from an instrument's file to a sentence for a publication. The data are ellipsometric
# angles of polymer brushes (chains tied to a surface by one end) on oxidised silicon, measured with an
# imaging ellipsometer. They come from the tests of the program refellips (H. Robertson, I. Gresham and A.
# Nelson, BSD licence); `measurements/README.md` gives details. The true thickness of these layers is
# unknown, as it usually is.
#
# An ellipsometer compares the reflection of light polarised in the plane of incidence (p) and perpendicular
# to it (s). Ψ gives the ratio of the two amplitudes, Δ the difference of the two phases, both in degrees.

# %%
import os
import textwrap
from dataclasses import replace

import jax
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer points, for a quick run
FOLDER = "../measurements/ellipsometry/"

# %% [markdown]
# ## Read the file
#
# Pellicle reads the instrument's file as it is. `notes` describes how it was read, and should always be
# checked.

# %%
with open(FOLDER + "15-1-1.dat", encoding="utf-8") as file:
    print("".join(line.expandtabs(10)[:80] + "\n" for line in file.read().splitlines()[:6]))
thin = pl.read_spectrum(FOLDER + "15-1-1.dat")
print(thin)
for note in thin.notes:
    print("  -", note)

# %% [markdown]
# The file contains one wavelength and several angles of incidence. It gives no errors of the measured
# angles, so these have to be estimated from the residuals of the fit.
#
# ## Write down the scene
#
# The scene, from the air down: the brush, about 2 nm of native oxide that every silicon wafer has, and
# silicon. Quantities that are not measured must be assumed, and stated: the oxide's thickness, and the
# polymer's index n = 1.47 + 4950/λ² (λ in nm, from refellips).


# %%
def brush(index=1.47, oxide=2.0):
    """Return a scene with a brush of unknown thickness; `index` is the coefficient A of its index."""
    layers = [
        pl.Layer(pl.dispersion.Cauchy(index, 4950.0), pl.Free(0, 300), name="brush"),
        pl.Layer("SiO2", oxide, name="oxide"),
    ]
    return pl.Scene(layers, "Si")


fit = pl.fit(thin, brush())
print(fit)
assert fit.status == "converged"

# %% [markdown]
# ## Look at the residuals
#
# The verdict alone is not sufficient. The residuals should look like noise.


# %%
def draw(fit):
    """Plot Ψ and Δ with the fit, and the residuals, against the angle of incidence."""
    curve, angle = fit.curve, fit.spectrum.angle
    _, (above, below) = plt.subplots(2, 1, figsize=(7, 5), sharex=True, height_ratios=[2, 1])
    above.plot(angle, curve.data, "o", color="C0", label="Ψ")
    above.plot(angle, curve.model, "-", color="C0")
    above.set_ylabel("Ψ (degrees)", color="C0")
    beside = above.twinx()
    beside.plot(angle, curve.delta_data, "s", color="C1", label="Δ")
    beside.plot(angle, curve.delta_model, "-", color="C1")
    beside.set_ylabel("Δ (degrees)", color="C1")
    beside.spines.right.set_visible(True)
    below.plot(angle, curve.residual, "o-", color="C0")
    below.plot(angle, curve.delta_residual, "s-", color="C1")
    below.axhline(0, color="0.7", zorder=0)
    below.set(xlabel="angle of incidence (degrees)", ylabel="data − fit (degrees)")
    plt.show()


draw(fit)
rms = [float(np.sqrt(np.mean(x**2))) for x in (fit.curve.residual, fit.curve.delta_residual)]
print(f"rms of Ψ {rms[0]:.2f}°, of Δ {rms[1]:.2f}°")
print(f"{len(thin)} points, effectively {fit.parts[0].effective_points:.1f} independent ones")
signs = np.sign(fit.curve.delta_residual)
print("signs of the residuals of Δ:", "".join("+" if x > 0 else "−" for x in signs))
assert fit.parts[0].effective_points < len(thin)

# %% [markdown]
# The points are close to the curve, but the residuals vary smoothly with the angle, which noise would not.
# Some assumption is not quite right: the index, the oxide, or the angles of the instrument. The fit cannot
# determine which, but it reduces the effective number of points, and its error includes what such
# assumptions usually add: it is several times that of the noise alone.
#
# ## Try another model
#
# Is it the index? `pl.compare` fits both models and compares them by their evidence Z (the likelihood with
# the usual errors of instruments and samples integrated out, averaged over the bounds of the free parameters;
# a difference of ln Z below 1 is no evidence, one above 5 is strong).

# %%
free_index = pl.Free(1.3, 1.7)
compared = pl.compare(thin, {"index assumed": brush(), "index free": brush(free_index)})
print(compared)
for candidate in compared.candidates:
    result = candidate.fit
    d = f"{result['brush.thickness'].value:.2f} ± {result['brush.thickness'].stderr:.2f} nm"
    print(f"  {candidate.name}: {d}, n at 658 nm = {float(result.curve.n[0]):.3f}, rms {result.rms:.3f}°")
either = [candidate.fit["brush.thickness"] for candidate in compared.candidates]
apart = abs(either[0].value - either[1].value)
print(f"the two thicknesses are {apart:.1f} nm apart")
assert apart < 2 * max(estimate.stderr for estimate in either)
for estimate in either:
    print(f"  ± {estimate.stderr:.2f} nm, of which ± {estimate.stderr_noise:.2f} nm by noise alone")

# %% [markdown]
# The evidence prefers the free index, and with it a thinner brush. But an index above 1.6 is implausible for
# this polymer. The two results agree within their errors, which allow for an angle or an oxide that is not
# quite as stated; the errors by noise alone do not. A criterion selects among the models that we offer, and
# the correct one may not be among them.
#
# Another hypothesis: all angles of incidence of the instrument are shifted by a small amount. We shift
# them, keep the assumed index, and compare the residuals, for this brush and for a thinner one of the same
# series.

# %%
shifts = np.linspace(-0.2, 0.3, 6 if SHORT else 26)
thinner = pl.read_spectrum(FOLDER + "19-1-1.dat")


def shifted(spectrum):
    """Return the fits of a spectrum with its angles of incidence shifted by each of the shifts (degrees)."""
    return [pl.fit(replace(spectrum, angle=spectrum.angle + shift), brush()) for shift in shifts]


series = {"15-1-1": shifted(thin), "19-1-1": shifted(thinner)}
figure, axes = plt.subplots(figsize=(7, 3.4))
for (name, fits), style in zip(series.items(), ("C0o-", "C1s-"), strict=True):
    axes.plot(shifts, [fit.rms for fit in fits], style, label=f"{name}, index assumed")
axes.axhline(compared.best.fit.rms, color="C0", linestyle=":", label="15-1-1, index free, no shift")
axes.set(
    xlabel="shift of all angles of incidence (degrees)",
    ylabel="rms of the residuals (degrees)",
    ylim=(0, None),
)
axes.legend()
plt.show()

best = {name: int(np.argmin([fit.rms for fit in fits])) for name, fits in series.items()}
for name, fits in series.items():
    after, before = fits[best[name]], fits[int(np.argmin(abs(shifts)))]
    print(
        f"{name}: {shifts[best[name]]:+.2f}°: rms {after.rms:.3f}° instead of {before.rms:.3f}°,"
        f" thickness {after['brush.thickness'].value:.2f} ± {after['brush.thickness'].stderr:.2f} nm"
    )
assert all(0 < shifts[at] < 0.2 for at in best.values())
assert series["15-1-1"][best["15-1-1"]].rms < 1.05 * compared.best.fit.rms

# %% [markdown]
# A shift of about a tenth of a degree explains the data as well as a free index does, with a plausible
# index, and both samples require about the same shift. The angles are therefore the more probable cause,
# and the thickness of the brush is about 16 nm, not 15. This is an argument, not a proof. The instrument's
# calibration of the angle, or a second wavelength, would settle the question.
#
# ## A thicker brush
#
# The third file contains 32 spots of one wafer with a thicker brush. A thicker layer determines more
# parameters: here its index can be free.

# %%
SPOTS = FOLDER + "post_synthesis.dat"
first = pl.read_spectrum(SPOTS, spot=1)
thick = pl.fit(first, brush(free_index))
print(thick)
draw(thick)
shift = {s: pl.fit(replace(first, angle=first.angle + s), brush()).rms for s in (-0.1, 0.0, 0.1)}
print("rms with all angles shifted:", ", ".join(f"{s:+.1f}°: {rms:.3f}°" for s, rms in shift.items()))
assert thick.status == "converged"
assert abs(thick["brush.A"].value - 1.47) < 0.003
assert min(shift, key=shift.get) == 0
assert thick.rms < 0.5 * fit.rms

# %% [markdown]
# The fitted index equals the value that we assumed before, although the fit did not use it, and these
# angles require no shift. The residuals are not pure noise either, but much smaller than before, so this
# model is more reliable than the previous one.
#
# ## Uncertainty of the assumptions
#
# The error by noise alone assumes that the oxide is exactly 2 nm thick, which is not certain. Optically both
# layers are nearly alike, so every nanometre of oxide too much is a nanometre of brush too little. Instead
# of fixing the oxide, we give it a normal *prior* of 2.0 ± 0.5 nm, and sample the posterior, the
# probability of all parameters, given the data and the prior.

# %%
believed = brush(free_index, pl.Free(0, 5, prior=pl.priors.Normal(2.0, 0.5)))
posterior = pl.sample(first, believed)
print(posterior)
checks = posterior.checks
print(f"  {checks.independent} independent draws, split R̂ {checks.rhat:.3f}")
assert posterior.trusted

thickness, oxide = posterior["brush.thickness"], posterior["oxide.thickness"]
grew = thickness.sd / thick["brush.thickness"].stderr_noise
print(f"the error of the thickness is {grew:.1f} times that by noise alone with the oxide fixed")
assert grew > 3

# %%
draws = {name: posterior.draws[..., i].ravel() for i, name in enumerate(posterior.names)}
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6))
left.plot(draws["oxide.thickness"], draws["brush.thickness"], ".", markersize=2, alpha=0.3)
left.set(xlabel="oxide (nm)", ylabel="brush (nm)")
right.hist(draws["brush.thickness"], 40, density=True, alpha=0.5, label="oxide 2.0 ± 0.5 nm")
middle, error = thick["brush.thickness"].value, thick["brush.thickness"].stderr_noise
at = np.linspace(68, 72, 400)
right.plot(
    at,
    np.exp(-0.5 * ((at - middle) / error) ** 2) / (error * np.sqrt(2 * np.pi)),
    "k",
    label="oxide fixed at 2 nm, noise alone",
)
right.set(xlabel="brush (nm)", ylabel="probability density (1/nm)")
right.legend(loc="upper right", fontsize="small")
plt.show()

# %% [markdown]
# Most of the uncertainty is not due to noise but to what the scene does not know exactly: the thickness of
# the oxide, the angle of incidence, offsets of Ψ and Δ. More points would not reduce it; a measurement of
# the bare wafer before coating would.
#
# ## Variation over the wafer
#
# We fit all 32 spots separately with the same scene.

# %%
columns = np.genfromtxt(SPOTS, skip_header=2, usecols=(5, 11, 12))  # zone, x and y in mm
places = columns[columns[:, 0] == 0][::5, 1:]  # five angles a spot
fits = [pl.fit(pl.read_spectrum(SPOTS, spot=spot), brush(free_index)) for spot in range(1, len(places) + 1)]
values = np.array([fit["brush.thickness"].value for fit in fits])
errors = np.array([fit["brush.thickness"].stderr for fit in fits])
index = np.array([float(fit.curve.n[0]) for fit in fits])
print(f"{len(fits)} spots, of which {sum(fit.status == 'converged' for fit in fits)} converged")
spread = values.std(ddof=1)
print(f"thickness from {values.min():.1f} to {values.max():.1f} nm, standard deviation {spread:.1f} nm")
print(f"median error of one spot {np.median(errors):.2f} nm, including the oxide {thickness.sd:.2f} nm")
print(f"n at 658 nm from {index.min():.4f} to {index.max():.4f}")
assert spread > 3 * thickness.sd

figure, axes = plt.subplots(figsize=(5.5, 4.5))
dots = axes.scatter(*places.T, c=values, s=120, cmap="viridis")
axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
axes.margins(0.12)
figure.colorbar(dots, label="thickness of the brush (nm)")
plt.show()

# %% [markdown]
# The thickness varies over the wafer by much more than the error of a single spot. Both numbers are
# correct, but they answer different questions: the thickness at one spot has an error of a fraction of a
# nanometre, the thickness of the brush on this wafer one of several.
#
# ## Text for a publication
#
# The text must allow a reader to assess and repeat the result: the measurement, the scene with all its
# assumptions, the method of the fit, the size of the error and what it includes, and what the data do not
# determine. The program inserts the numbers, so that they agree with the results.

# %%
low, high = first.angle.min(), first.angle.max()
nearest = min(rival.delta_chi2 for rival in thick.rivals)
sentences = [
    f"Ψ and Δ were measured at {first.wavelength[0]:.0f} nm and {len(first)} angles of incidence from",
    f"{low:.1f}° to {high:.1f}° at {len(fits)} spots of one wafer, and fitted with pellicle",
    f"{pl.__version__}. The scene was air, the polymer, native oxide and silicon",
    f"(n and k of {pl.material('Si').citation}).",
    "The polymer's thickness and index were free (n = A + 4950 nm²/λ²); the oxide was taken as",
    "2.0 ± 0.5 nm and marginalised over. No noise was stated, so it was estimated from the residuals,",
    f"which are {thick.rms:.2f}° rms. At the first spot the thickness is {thickness.q50:.1f} nm, with a",
    f"95 % interval from {thickness.q025:.1f} to {thickness.q975:.1f} nm. Over the wafer it is",
    f"{values.mean():.1f} nm with a standard deviation of {spread:.1f} nm, with the oxide at 2 nm.",
    f"The index at 658 nm is {index.mean():.3f} ± {index.std(ddof=1):.3f} (standard deviation over the",
    "spots). No other thickness between 0 and 300 nm fits: the next best is worse by",
    f"Δχ² = {nearest:.0f}.",
]
print(textwrap.fill(" ".join(sentences), 100))
print("\nsha256 of the data:", first.sha256[:16], "…")

# %% [markdown]
# Publish the data and the recipe with the text. `fits/brush_post_synthesis` in the repository contains both
# for the first spot; this cell repeats its fit from Python, as `pellicle fit --recipe` does:

# %%
recipe = pl.read_recipe("../fits/brush_post_synthesis/recipe.toml")
again = pl.fit(pl.read_spectrum(recipe.files[0]), recipe.scene())
print(again)
assert np.isclose(again["brush.thickness"].value, thick["brush.thickness"].value, atol=0.01)
