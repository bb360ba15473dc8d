# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Gradients: sensitivity and the Cramér-Rao bound
#
# The optics of pellicle are differentiable. This notebook uses the derivatives to answer two questions.
#
# 1. How fast does the colour of a film change with its thickness?
# 2. At which angles and wavelengths should a film be measured, and how precisely can its parameters be
#    determined?
#
# The derivatives are computed by [JAX](https://docs.jax.dev), the array library that pellicle is written
# in. `jax.grad(f)` is a function, the derivative of an `f` that returns one number. `jax.jacfwd(f)` is the
# same for an `f` that returns an array. They are not difference quotients: JAX applies the rules of
# calculus to the program, so the result is exact except for rounding. `jax.vmap(f)` evaluates `f` for an
# array of inputs at once, and `jax.jit` compiles a function.

# %%
import os

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl
from pellicle.colour import film_colour

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer points, for a quick run

# %% [markdown]
# ## The colour of an oxide on silicon
#
# A wafer with an oxide of some hundred nanometres shows strong colours; in clean rooms the thickness is
# estimated from a printed chart. `film_colour` computes the colour under daylight (D65). In the CIE
# L\*a\*b\* space a distance of 1, written ΔE, is about the smallest difference that is visible when two
# colours are side by side.

# %%
OXIDE, SILICON = pl.material("SiO2"), pl.material("Si")


@jax.jit
def colour(thickness):
    """Return L*, a*, b* and sRGB of oxides of these thicknesses (nm), from 64 wavelengths."""
    colours = film_colour(thickness, OXIDE, SILICON, method="uniform-64")
    return colours.lab, colours.srgb


@jax.jit
@jax.vmap
def lab_slope(thickness):
    """Return the derivative of L*, a*, b* per nm."""
    return jax.jacfwd(lambda d: colour(d)[0])(thickness)


thickness = jnp.linspace(0.0, 600.0, 121 if SHORT else 601)
lab, srgb = colour(thickness)
slope = lab_slope(thickness)  # (thicknesses, 3)

step = 1e-3  # nm
quotient = (colour(thickness + step)[0] - colour(thickness - step)[0]) / (2 * step)
apart = float(jnp.max(jnp.abs(slope - quotient)))
print(f"derivative and difference quotient agree to {apart:.1e} per nm")
assert apart < 1e-5

# %%
speed = np.linalg.norm(slope, axis=1)  # ΔE per nm
figure, (above, middle, below) = plt.subplots(
    3, 1, figsize=(8, 5.5), sharex=True, height_ratios=[0.5, 1.5, 1.2]
)
above.imshow(np.asarray(srgb)[None], extent=(0, 600, 0, 1))
above.set(yticks=[], title="SiO2 on silicon under D65, normal incidence")
for values, name, style in zip(lab.T, ("L*", "a*", "b*"), ("k-", "C1--", "C0:"), strict=True):
    middle.plot(thickness, values, style, label=name)
middle.set(ylabel="L*, a*, b*")
middle.legend(ncols=3)
below.plot(thickness, speed, "k")
below.set(xlabel="thickness (nm)", ylabel="colour change\n(ΔE per nm)", ylim=(0, None))
plt.show()

best = int(np.argmax(speed))
worst = int(np.argmin(np.where(thickness > 50, speed, np.inf)))
print(f"most sensitive at {thickness[best]:.0f} nm: {speed[best]:.2f} ΔE per nm")
print(f"least sensitive above 50 nm at {thickness[worst]:.0f} nm: {speed[worst]:.2f} ΔE per nm")
assert speed[best] > 1 > speed[worst]

# %% [markdown]
# Where the curve is highest, a colour difference of ΔE = 1 corresponds to less than a nanometre; where it
# is lowest, to more than one. At 0 nm the colour hardly changes: a thin transparent layer changes the
# reflectance only in proportion to the square of its thickness, so a native oxide of 2 nm is invisible.

# %%
thin = jnp.linspace(0.0, 600.0, thickness.size).at[1].set(2.0)  # same length: no new compilation
first = float(np.linalg.norm(colour(thin)[0][1] - lab[0]))
print(f"2 nm of oxide change the colour by ΔE {first:.2f}")
assert first < 0.5

# %% [markdown]
# ## The Cramér-Rao bound of a measurement
#
# Take a film of 80 nm on silicon with an index of 1.8 + 0.02i, with unknown thickness d, n and k. The
# information that a measured value y with standard deviation σ contains about them depends on its
# derivatives. The *Fisher information* of all measured values is the matrix F = Σ (∂y/∂p)(∂y/∂p)ᵀ / σ²,
# with p = (d, n, k). No unbiased estimator has standard deviations below the square roots of the diagonal
# of F⁻¹, the *Cramér-Rao bound*. An instrument can thus be assessed before it is built, and an experiment
# before it is done, from derivatives alone.
#
# ### Which angles?
#
# A laser ellipsometer measures Ψ and Δ at one wavelength, here 633 nm, with a noise of 0.02° in Ψ and 0.05°
# in Δ.

# %%
TRUTH = jnp.array([80.0, 1.8, 0.02])
NOISE = np.array([0.02, 0.05])  # degrees of Ψ and Δ
angles = np.arange(45.0, 86.0, 1.0)


def psi_delta(p, wavelength, angle, substrate):
    """Return Ψ and Δ of the film in degrees, with shape (points, 2)."""
    psi_and_delta = pl.ellipsometry(wavelength, p[0], p[1] + 1j * p[2], substrate, angle=angle)
    return jnp.stack(psi_and_delta, axis=-1)


@jax.jit
def angle_information(wavelength, angle, substrate):
    """Return the derivatives of Ψ and Δ in d, n and k, divided by the noise, with shape (points, 2, 3)."""
    return jax.jacfwd(psi_delta)(TRUTH, wavelength, angle, substrate) / NOISE[:, None]


def bound(information):
    """Return the Cramér-Rao bounds of d (nm), n and k."""
    return np.sqrt(np.diag(np.linalg.inv(information)))


weighted = np.asarray(
    angle_information(np.full(angles.size, 633.0), angles, np.full(angles.size, 3.87 + 0.015j))
)
information = np.einsum("ayp,ayq->apq", weighted, weighted)  # of each angle, (angles, 3, 3)

rank = np.linalg.matrix_rank(weighted)
print(f"rank of the derivatives at one angle: {rank.min()} to {rank.max()}, of 3 unknowns")
assert np.all(rank == 2)

pairs = np.full((angles.size, angles.size), np.nan)
for i in range(angles.size):
    for j in range(i + 1, angles.size):
        pairs[i, j] = bound(information[i] + information[j])[0]
first, second = np.unravel_index(np.nanargmin(pairs), pairs.shape)
close = pairs[angles == 70, angles == 72][0]
print(f"best pair: {angles[first]:.0f}° and {angles[second]:.0f}°, d within {pairs[first, second]:.2f} nm")
print(f"70° and 72°: d within {close:.1f} nm")
fan = bound(information.sum(axis=0))
print(f"all {angles.size} angles: d within {fan[0]:.2f} nm, n {fan[1]:.4f}, k {fan[2]:.4f}")
assert close > 5 * pairs[first, second]
assert angles[second] - angles[first] > 15

# %%
figure, axes = plt.subplots(figsize=(6, 4.4))
edges = (angles[0] - 0.5, angles[-1] + 0.5)
image = axes.imshow(
    np.log10(pairs.T), extent=(*edges, *edges), cmap="viridis_r", vmin=-0.5, vmax=1.5, aspect="equal"
)
axes.plot(angles[first], angles[second], "r+", markersize=12)
axes.set(xlabel="first angle of incidence (degrees)", ylabel="second angle (degrees)")
bar = figure.colorbar(image, ax=axes, label="bound on the error of the thickness (nm)")
bar.set_ticks([-0.5, 0, 0.5, 1, 1.5], labels=["0.3", "1", "3", "10", "30"])
plt.show()

# %% [markdown]
# One angle gives two values, which do not determine three unknowns, however small the noise: their
# derivatives have rank two. Two angles do. Neighbouring angles give nearly the same information; the angles
# of the best pair are far apart (red cross).

# %% [markdown]
# ### Which wavelengths?
#
# A spectrometer at normal incidence measures R from 400 to 800 nm with a noise of 0.002. Here n and k are
# the same at all wavelengths. Three unknowns require at least three wavelengths. We choose the best three
# on a grid of 10 nm, and then repeatedly add the wavelength that reduces the bound on the thickness most.

# %%
nm = np.linspace(400.0, 800.0, 41 if SHORT else 201)
WAFER = pl.refractive_index(nm, "Si")
R_NOISE = 0.002

slopes = jax.jit(jax.jacfwd(lambda p: pl.reflectance(nm, p[0], p[1] + 1j * p[2], WAFER)))(TRUTH)
each = np.einsum("wp,wq->wpq", slopes, slopes) / R_NOISE**2  # information of each wavelength


def errors_of(chosen):
    """Return bounds for sets of wavelengths, with shape (sets, 3); infinite if a set does not determine p."""
    total = each[chosen].sum(axis=-3)
    scale = np.sqrt(np.einsum("spp->sp", total))
    unit = total / (scale[:, :, None] * scale[:, None, :])  # 1 along the diagonal: safe to invert
    good = np.linalg.det(unit) > 1e-12
    inverse = np.linalg.inv(np.where(good[:, None, None], unit, np.eye(3)))
    return np.where(good[:, None], np.sqrt(np.einsum("spp->sp", inverse)) / scale, np.inf)


coarse = np.arange(0, nm.size, nm.size // 40)
triples = np.array([(a, b, c) for a in coarse for b in coarse for c in coarse if a < b < c])
chosen = list(triples[np.argmin(errors_of(triples)[:, 0])])
print(f"best three wavelengths: {', '.join(f'{nm[i]:.0f}' for i in chosen)} nm")
greedy, even = [], []
for count in range(3, 13):
    greedy.append(errors_of(np.array([chosen]))[0, 0])
    even.append(errors_of(np.linspace(0, nm.size - 1, count).round().astype(int)[None])[0, 0])
    grown = np.array([[*chosen, i] for i in range(nm.size)])
    chosen = list(grown[np.argmin(errors_of(grown)[:, 0])])
print("wavelengths        " + "".join(f"{count:7d}" for count in range(3, 13)))
print("chosen, error in nm" + "".join(f"{x:7.2f}" for x in greedy))
print("evenly spaced      " + "".join(f"{x:7.2f}" for x in even))
assert all(a < b for a, b in zip(greedy, even, strict=True))

# %%
figure, (above, below) = plt.subplots(2, 1, figsize=(8, 5))
for values, label, style in (
    (slopes[:, 0] * 1.0, "d by 1 nm", "k-"),
    (slopes[:, 1] * 0.01, "n by 0.01", "C0--"),
    (slopes[:, 2] * 0.01, "k by 0.01", "C1:"),
):
    above.plot(nm, values, style, label=label)
above.plot(nm[chosen], np.zeros(len(chosen)), "kv", label="chosen")
above.set(xlabel="wavelength (nm)", ylabel="change of R")
above.legend(ncols=4)
below.plot(range(3, 13), even, "C0o--", label="evenly spaced")
below.plot(range(3, 13), greedy, "ko-", label="chosen one by one")
below.set(xlabel="number of wavelengths", ylabel="bound on the error of d (nm)", ylim=(0, None))
below.legend()
plt.show()

places = np.unique(chosen)
names = ", ".join(f"{nm[i]:.0f}" for i in places)
print(f"{len(chosen)} measurements at {places.size} different wavelengths: {names} nm")
assert places.size < len(chosen)

# %% [markdown]
# For the same number of points the chosen wavelengths give a smaller bound than evenly spaced ones. The
# method chooses a few wavelengths repeatedly: three parameters are best determined at a few wavelengths at
# which their effects differ. This relies on n and k being constant. The index of a real film varies with
# the wavelength, and a spectrum also reveals a wrong model, so measure at more wavelengths than these, with
# most of the measuring time at the most informative ones.

# %% [markdown]
# ### Which instrument?
#
# The next cell compares three instruments for the same film over the same wavelengths.

# %%
p_light = jax.jit(
    jax.jacfwd(lambda p: pl.reflectance(nm, p[0], p[1] + 1j * p[2], WAFER, angle=70.0, polarisation="p"))
)
ellipsometer = angle_information(nm, np.full(nm.size, 70.0), WAFER)
tables = {
    "R at 0°": np.asarray(slopes) / R_NOISE,
    "R of p light at 70°": np.asarray(p_light(TRUTH)) / R_NOISE,
    "Ψ and Δ at 70°": np.asarray(ellipsometer).reshape(-1, 3),
}
print(f"{'':20}  d (nm)    n        k")
limits = {name: bound(j.T @ j) for name, j in tables.items()}
for name, (d, n, k) in limits.items():
    print(f"{name:20}  {d:.4f}  {n:.5f}  {k:.5f}")
assert limits["Ψ and Δ at 70°"][0] < 0.2 * limits["R at 0°"][0]

# %% [markdown]
# Ellipsometry is much more precise, as is well known: Δ is a phase, and depends on the thickness even where
# intensities hardly change.
#
# ## Does a fit reach the bound?
#
# The bound holds for every unbiased method. We simulate noisy spectra at normal incidence, fit d, n and k,
# and compare the bound with the errors that the fits report and with the scatter of the results.

# %%
# each Free has a start value, which is simulated, and bounds, between which a fit searches
film = pl.Layer(
    pl.dispersion.Constant(pl.Free(1.5, 2.2, start=1.8), pl.Free(0.0, 0.2, start=0.02)),
    pl.Free(20, 200, start=80.0),
)
scene = pl.Scene(film, "Si")
NAMES = ("thickness", "n", "k")
fits = [pl.fit(pl.simulate(scene, nm, noise=R_NOISE, seed=seed), scene) for seed in range(8 if SHORT else 60)]
print(fits[0], "\n")

there = [abs(fit["thickness"].value - 80) < 5 for fit in fits]
near = [fit for fit, is_near in zip(fits, there, strict=True) if is_near]
answers = np.array([[fit[name].value for name in NAMES] for fit in near])
stated = np.array([[fit[name].stderr_noise for name in NAMES] for fit in near])
print(f"           bound    stated   scatter of {len(near)} fits near 80 nm")
for i, name in enumerate(NAMES):
    least = limits["R at 0°"][i]
    print(f"{name:9}  {least:.5f}  {np.median(stated[:, i]):.5f}  {np.std(answers[:, i], ddof=1):.5f}")
assert np.allclose(np.median(stated, axis=0), limits["R at 0°"], rtol=0.15)

far = [fit for fit, is_near in zip(fits, there, strict=True) if not is_near]
others = [f"{fit['thickness'].value:.1f} nm ({fit.status})" for fit in far]
print(f"{len(far)} of {len(fits)} fits are elsewhere: {', '.join(others) or 'none'}")
rival = min(fits[0].rivals, key=lambda rival: rival.delta_chi2)
thinner = rival.parameters
print(f"the nearest rival of the first fit: {thinner['thickness']:.1f} nm, n {thinner['n']:.2f}")
assert thinner["thickness"] < 80
assert thinner["n"] > 1.8
assert all(fit.status == "ambiguous" for fit in far)

# %% [markdown]
# The reported errors equal the bound, apart from differences between noisy spectra, and the results scatter
# by about as much. The bound, however, describes the neighbourhood of one solution only. This film has a
# rival: a thinner film with a higher index. Occasionally the noise makes the rival fit best. The fit then
# has the status `ambiguous`; the bound contains no such information. Notebook 6 continues with this case.
