# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Limits of identifiability
#
# A fit always returns a number. Whether the data determine it is a separate question. This notebook shows
# four cases in which a spectrum determines less than it seems to, the report of pellicle in each case, and
# remedies.
#
# 1. Two parameters are strongly correlated.
# 2. Another thickness fits as well.
# 3. No light returns from the lower face.
# 4. A single standard error does not describe the uncertainty: the *posterior*, the probability of every
#    value, does.
#
# The misfit is χ² = Σ ((data − model) / σ)², where σ is the noise. Δχ² is the difference from the best fit:
# 1 corresponds to one standard deviation, 4 to two.

# %%
import os

import emcee
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl
from pellicle.sampling.chain import split_rhat

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer points, for a quick run

# %% [markdown]
# ## Two strongly correlated parameters
#
# Consider a transparent film on silicon with unknown thickness and index, measured from 450 to 750 nm with
# a noise of 0.001 in R, with a thickness of 15 nm and of 120 nm. The figure shows χ² for every pair of
# thickness and index. The data are without noise, so that the true values fit exactly.

# %%
nm = np.linspace(450.0, 750.0, 31)
NOISE = 0.001
SILICON = pl.material("Si")


@jax.jit
def delta_chi2(truth, thickness, index):
    """Return Δχ² with shape (indices, thicknesses) for a film with thickness (nm) and index `truth`."""
    data = pl.reflectance(nm, truth[0], truth[1], SILICON)
    model = pl.reflectance(nm, thickness[None, :, None], index[:, None, None], SILICON)
    return jnp.sum(((data - model) / NOISE) ** 2, axis=-1)


index = np.linspace(1.3, 1.7, 101 if SHORT else 201)
films = {"15 nm": (15.0, np.linspace(8, 24, 101)), "120 nm": (120.0, np.linspace(112, 128, 101))}
maps = {name: delta_chi2(np.array([d, 1.46]), grid, index) for name, (d, grid) in films.items()}

figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True)
for at, (name, (d, grid)) in zip(axes, films.items(), strict=True):
    shades = at.pcolormesh(
        grid, index, maps[name], norm="log", vmin=1, vmax=1e5, cmap="Blues", rasterized=True
    )
    at.contour(grid, index, maps[name], levels=[4], colors="C1")
    at.plot(d, 1.46, "k+", markersize=10)
    at.set(xlabel="thickness (nm)", title=f"a film of {name}")
axes[0].set_ylabel("index n")
figure.colorbar(shades, label="Δχ² (orange: 4, two standard deviations)")
plt.show()

# %%
best_thickness = films["15 nm"][1][np.argmin(maps["15 nm"], axis=1)]
ends = best_thickness[[0, -1]]
power = np.log(ends[1] / ends[0]) / np.log(index[-1] / index[0])
print(f"along the minimum n goes from {index[0]} to {index[-1]}, d from {ends[0]:.1f} to {ends[1]:.1f} nm")
print(f"d is proportional to n to the power of {power:.2f} there")
print(f"largest Δχ² along it: {maps['15 nm'].min(axis=1).max():.1f}")
assert maps["15 nm"].min(axis=1).max() < 9
assert maps["120 nm"].min(axis=1).max() > 1000

# %% [markdown]
# The misfit of the thin film has a narrow valley: for every index there is a thickness that fits nearly as
# well. The spectrum determines one combination of the two. (It is not exactly the product n·d, which
# fringes determine in a thicker film.) The film of 120 nm has no such valley: the cross lies in a closed
# contour that is too small to be visible here.
#
# Next we fit spectra with noise. The noise determines where in the valley the best fit lies: for this
# spectrum it is where the valley meets the bound of n. A fit also allows for systematic effects, such as a
# scale that is a little off; this notebook studies the noise alone, so its scenes state that everything else
# is exact.


# %%
def measured(thickness):
    """Return a spectrum of the film with noise."""
    return pl.simulate(pl.Scene(pl.Layer(1.46, thickness), "Si"), nm, noise=NOISE, seed=1)


noise_alone = pl.Uncertainty.none()
both_free = pl.Scene(pl.Layer(pl.Free(1.3, 1.7), pl.Free(0, 200)), "Si", uncertainty=noise_alone)
for thickness in (15.0, 120.0):
    fit = pl.fit(measured(thickness), both_free)
    print(f"{thickness:.0f} nm, both free: {fit}")
    print(f"  correlation of n and thickness {fit.correlation[0, 1]:+.4f}\n")
    assert (fit.status == "converged") == (thickness == 120.0)

# %% [markdown]
# The remedy is information from another source. With the index of the material fixed, the same spectrum
# determines the thickness:

# %%
fixed = pl.Scene(pl.Layer(1.46, pl.Free(0, 200)), "Si", uncertainty=noise_alone)
fit = pl.fit(measured(15.0), fixed)
print(f"n fixed: {fit}")
assert fit.status == "converged"
assert abs(fit["thickness"].value - 15) < 4 * fit["thickness"].stderr < 1

# %% [markdown]
# ## Another thickness fits as well
#
# The colours of a film recur as it grows. A camera with a few filters records few values, and more than one
# thickness may explain them. The example is a film (index 1.46, on silicon, 650 nm thick) measured in
# several bands between 450 and 800 nm, with a noise of 4 %. The curves show the expected Δχ² of every other
# thickness.

# %%
thicknesses = np.linspace(50.0, 1500.0, 2901)


@jax.jit
def through_bands(bands):
    """Return the reflectance with shape (thicknesses, bands); bands of 0 are padding."""
    reflectances = pl.reflectance(jnp.where(bands > 0, bands, 500.0), thicknesses[:, None], 1.46, SILICON)
    return jnp.where(bands > 0, reflectances, 0.0)


def rivals_of(curve):
    """Return the number of separate intervals below Δχ² = 6, including the true one."""
    inside = curve < 6
    return int(inside[0]) + int(np.sum(inside[1:] & ~inside[:-1]))


truth_at = int(np.argmin(abs(thicknesses - 650)))
counts = (3, 5, 9, 33)
figure, axes = plt.subplots(len(counts), 1, figsize=(8, 6), sharex=True)
places = []
for at, count in zip(axes, counts, strict=True):
    bands = np.concatenate([np.linspace(450, 800, count), np.zeros(33 - count)])
    reflectances = through_bands(bands)
    curve = np.asarray(jnp.sum(((reflectances - reflectances[truth_at]) / 0.04) ** 2, axis=1))
    places.append(rivals_of(curve))
    at.plot(thicknesses, curve, "k")
    at.axhline(6, color="C0", linestyle=":")
    at.axvline(650, color="C1", linestyle="--")
    at.set(yscale="symlog", ylim=(0, 1000), yticks=[0, 10, 1000], ylabel="Δχ²")
    at.set_title(f"{count} bands", loc="left", fontsize="small")
    print(f"{count:2d} bands: {places[-1]} thicknesses with an expected Δχ² below 6")
axes[-1].set_xlabel("thickness (nm)")
plt.show()
assert places[0] > places[-1] == 1

# %% [markdown]
# Three bands leave several solutions; many bands leave one, even though each has the same noise. With five
# bands the true one is only just unique: noise can bring the neighbour near 440 nm below the line.
# `docs/examples/five_bands.csv` is such a data set. A fit scans the whole range of thickness, keeps every
# other minimum as a *rival*, and reports the status `ambiguous` if one of them fits about as well (Δχ²
# below 6).

# %%
five = pl.read_spectrum("../docs/examples/five_bands.csv")
scene = pl.Scene(pl.Layer(1.46, pl.Free(50, 1500)), "Si", uncertainty=noise_alone)
ambiguous = pl.fit(five, scene)
print(ambiguous)
for rival in sorted(ambiguous.rivals, key=lambda rival: rival.delta_chi2)[:3]:
    print(f"  rival: {rival.parameters['thickness']:.1f} nm, Δχ² {rival.delta_chi2:.1f}")
assert ambiguous.status == "ambiguous"

# %% [markdown]
# The best fit and its error bar do not show the ambiguity: the error bar is correct, but only for solutions
# in that minimum.
#
# ## No light returns from the lower face
#
# Gold absorbs. Light that reaches the lower face of a gold film and returns has lost 1 − exp(−8πkd/λ) of
# its power, where k is the extinction coefficient. Once this is nearly all, the reflected light does not
# depend on the thickness. `measurements/gold_on_glass_300nm.csv` was simulated with 300 nm and a noise of
# 0.002.

# %%
gold = pl.read_spectrum("../measurements/gold_on_glass_300nm.csv")
opaque = pl.fit(gold, pl.Scene(pl.Layer("Au", pl.Free(10, 1000)), "BK7", uncertainty=noise_alone))
print(opaque)
limit = opaque["thickness"].lower_limit
assert opaque.status == "not-identifiable"
assert limit < 300

# %%
tried = np.array([60.0, 100.0, limit, 300.0, 1000.0])
AU, BK7 = pl.material("Au"), pl.material("BK7")
reflected = jax.jit(lambda d: pl.reflectance(gold.wavelength, d[:, None], AU, BK7))(tried)
change = np.asarray(reflected - reflected[-1])
figure, axes = plt.subplots()
for d, row, style in zip(tried[:4], change[:4], ("C1-", "C2--", "C0-", "k:"), strict=True):
    axes.plot(gold.wavelength, row, style, label=f"{d:.0f} nm")
axes.axhspan(-0.002, 0.002, color="0.9", label="noise, ± σ")
axes.set(xlabel="wavelength (nm)", ylabel="R − R of 1000 nm of gold", ylim=(-0.006, 0.006))
axes.legend(ncols=2)
plt.show()
for d, row in zip(tried, change, strict=True):
    print(f"{d:6.0f} nm: R differs from that of 1000 nm by {np.abs(row).max():.1e} at most")
assert np.abs(change[2]).max() < 0.002
assert np.abs(change[3]).max() < 1e-6

# %% [markdown]
# A film at the limit reflects like an infinitely thick one to within the noise, and for one of 300 nm the
# difference is far too small to be measured. The report therefore gives a one-sided limit instead of a
# value with an error: with 95 % probability the film is at least that thick. Remedies are another kind of
# measurement: transmission, if any light is transmitted, or a step in the film and a profilometer.
#
# ## How probable is each thickness?
#
# Back to the five bands, which two thicknesses explain. How probable is each? The *posterior* is the
# probability of every thickness, given the data and the prior (here uniform from 50 to 1500 nm). With a
# single unknown it can be computed on a grid: exp(−χ²/2) at every thickness, normalised.

# %%
grid = np.linspace(50.0, 1500.0, 14501)


@jax.jit
def log_probability(thickness):
    """Return −χ²/2 of each thickness (nm) for the five bands; −∞ outside the bounds."""
    model = pl.reflectance(five.wavelength, thickness[:, None], 1.46, SILICON)
    chi2 = jnp.sum(((five.values - model) / five.sigma) ** 2, axis=1)
    return jnp.where((thickness > 50) & (thickness < 1500), -0.5 * chi2, -jnp.inf)


weight = np.exp(log_probability(grid) - log_probability(grid).max())
density = weight / (weight.sum() * (grid[1] - grid[0]))  # per nm


def share(thickness):
    """Return the fraction of thicknesses within 80 nm of the second minimum at 438 nm."""
    return float(np.mean(abs(thickness - 438) < 80))


exact = float(weight[abs(grid - 438) < 80].sum() / weight.sum())
print(f"on the grid: {100 * exact:.1f} % near 438 nm")

# %% [markdown]
# With more unknowns grids become too large, and one draws samples instead: walkers move at random such that
# they visit every region in proportion to its probability. emcee is the most widely used package for this.
# A common recipe starts all walkers in a small ball around the best fit:

# %%
best = ambiguous["thickness"].value
ball = best + 0.1 * np.random.default_rng(0).standard_normal((32, 1))
sampler = emcee.EnsembleSampler(32, 1, lambda x: np.asarray(log_probability(x[:, 0])), vectorize=True)
sampler.random_state = np.random.RandomState(0).get_state()
sampler.run_mcmc(ball, 2000 if SHORT else 10_000)
chain = sampler.get_chain(discard=200)
print(f"from a ball: {100 * share(chain):.1f} % near 438 nm")
print(
    f"  split R̂ {split_rhat(chain):.3f}, {100 * sampler.acceptance_fraction.mean():.0f} % of moves accepted"
)

# %% [markdown]
# R̂ compares the walkers with each other: 1 means agreement. Here R̂ is close to 1, so the chain passes
# this test. The walkers agree because they all started in the same minimum. `pl.sample` starts walkers in
# every minimum that the fit found, and proposes jumps between minima:

# %%
posterior = pl.sample(five, scene)
draws = posterior.draws.ravel()
print(posterior)
print(f"pl.sample: {100 * share(draws):.1f} % near 438 nm")
assert posterior.trusted
assert abs(share(draws) - exact) < 0.06
assert share(chain) == 0
assert split_rhat(chain) < 1.05

# %%
figure, axes = plt.subplots(figsize=(8, 3.6))
bins = np.arange(400.0, 680.0, 2.0)
axes.hist(draws, bins, density=True, color="C0", alpha=0.5, label="pl.sample")
axes.hist(chain.ravel(), bins, density=True, histtype="step", color="C1", label="emcee from a ball")
axes.plot(grid, density, "k", linewidth=1, label="grid")
error = ambiguous["thickness"].stderr
normal = np.exp(-0.5 * ((grid - best) / error) ** 2) / (error * np.sqrt(2 * np.pi))
axes.plot(grid, normal, "k:", linewidth=1, label="best fit and its standard error")
axes.set(xlabel="thickness (nm)", ylabel="probability density (1/nm)", xlim=(400, 680))
axes.legend(loc="upper left", bbox_to_anchor=(0.3, 1))
plt.show()

# %% [markdown]
# The samples of `pl.sample` follow the grid; those from a ball follow only the error of the best fit, and
# miss the other solution.
#
# ## Prior knowledge
#
# The posterior combines data and prior. Suppose that the film was made with a target of 430 nm by a process
# with a standard deviation of 100 nm. This prior, written beside the bounds, changes the result:

# %%
thickness = pl.Free(50, 1500, prior=pl.priors.Normal(430, 100))
believed = pl.Scene(pl.Layer(1.46, thickness), "Si", uncertainty=noise_alone)
informed = pl.sample(five, believed)
prior = np.exp(-0.5 * ((grid - 430) / 100) ** 2)
exact = float((weight * prior)[abs(grid - 438) < 80].sum() / (weight * prior).sum())
print(informed)
print(f"near 438 nm: {100 * share(informed.draws):.1f} %, on the grid {100 * exact:.1f} %")
assert abs(share(informed.draws) - exact) < 0.05
assert exact > 0.5

# %% [markdown]
# The data alone favour the other thickness, three to one; with the prior, this one is more probable. A
# publication of such a result should state its prior.
