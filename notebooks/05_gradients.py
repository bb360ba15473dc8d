# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Gradients: sensitivity, design, and what an instrument can see
#
# The optics of pellicle can be differentiated. This notebook uses the derivatives for three questions.
#
# 1. How fast does the colour of a film change with its thickness?
# 2. Which layers make a good antireflection coating?
# 3. At which angles and wavelengths should one measure a film, and how well can it be known?
#
# Derivatives come from [JAX](https://docs.jax.dev), the library of arrays that pellicle is written in.
# `jax.grad(f)` is a function: the derivative of `f`, which returns one number. `jax.jacfwd(f)` does the
# same for an `f` that returns an array. Neither is a difference quotient: the rules of calculus are
# applied to the program itself, so the result is exact but for rounding. `jax.vmap(f)` is `f` over an
# array of inputs at once, and `jax.jit` compiles a function.

# %%
import os

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize

import pellicle as pl
from pellicle.colour import film_colour

jax.config.update("jax_enable_x64", True)  # 16 digits in place of JAX's usual 7
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # the automatic tests take fewer points

# %% [markdown]
# ## The colour of an oxide on silicon
#
# A wafer with an oxide of some hundred nanometres shows strong colours; people in clean rooms read the
# thickness from a printed chart. `film_colour` gives the colour under daylight (D65). In the CIE space
# L\*a\*b\* a distance of 1, written ΔE, is about what an eye can just tell apart when two colours lie
# side by side.

# %%
OXIDE, SILICON = pl.material("SiO2"), pl.material("Si")


@jax.jit
def colour(thickness):
    """L*, a*, b* and sRGB of oxides of these thicknesses (nm), with 64 wavelengths."""
    seen = film_colour(thickness, OXIDE, SILICON, way="uniform-64")
    return seen.lab, seen.srgb


@jax.jit
@jax.vmap
def lab_slope(thickness):
    """The derivative of L*, a*, b* per nm."""
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
# Where the curve is highest, an eye that sees ΔE = 1 tells less than a nanometre. Where it is lowest it
# takes more than one. At 0 nm the colour hardly changes: a thin transparent layer acts on light only
# through the square of its thickness, which is why a native oxide of 2 nm cannot be seen.

# %%
thin = jnp.linspace(0.0, 600.0, thickness.size).at[1].set(2.0)  # one program serves arrays of one length
first = float(np.linalg.norm(colour(thin)[0][1] - lab[0]))
print(f"2 nm of oxide change the colour by ΔE {first:.2f}")
assert first < 0.5

# %% [markdown]
# ## Design: an antireflection coating
#
# Glass reflects about 4 % at each face. One layer of MgF2, a quarter of a wavelength thick, brings that
# down, most of all at one wavelength. Can three layers (MgF2, HfO2 and Al2O3 from the air down) do better
# over the whole visible range? The *loss*, the number to make small, is the mean reflectance from 420 to
# 680 nm. `pl.reflectance` takes a list of layers; `jax.value_and_grad` gives the loss with its slope in
# all three thicknesses.
#
# SciPy's minimiser goes downhill by that slope. Going downhill finds the nearest minimum, not the
# deepest, so we start from many random designs.

# %%
band = np.linspace(420.0, 680.0, 27)
STACK = [pl.material(name) for name in ("MgF2", "HfO2", "Al2O3")]
GLASS = pl.material("BK7")


@jax.jit
def spectrum(thicknesses):
    """Reflectance over the band of glass under three layers of these thicknesses (nm)."""
    return pl.reflectance(band, thicknesses, STACK, GLASS)


def mean_percent(thicknesses):
    return 100 * jnp.mean(spectrum(thicknesses))


loss = jax.jit(jax.value_and_grad(mean_percent))
random = np.random.default_rng(0)
designs = [
    minimize(loss, start, jac=True, method="L-BFGS-B", bounds=[(0, 300)] * 3)
    for start in random.uniform(10, 200, (8 if SHORT else 64, 3))
]
losses = np.array([one.fun for one in designs])
best = designs[int(np.argmin(losses))]

bare = spectrum(np.zeros(3))
quarter = 550 / 4 / float(pl.refractive_index(550.0, "MgF2").real)
single = spectrum(np.array([quarter, 0.0, 0.0]))
print(
    f"mean reflectance: bare {100 * bare.mean():.2f} %, {quarter:.0f} nm of MgF2 {100 * single.mean():.2f} %,"
)
print(f"three layers {best.fun:.3f} %: {', '.join(f'{d:.1f}' for d in best.x)} nm from the air down")
same = int(np.sum(losses < 1.02 * best.fun))
print(f"{same} of {len(losses)} starts end there; the worst of the others at {losses.max():.2f} %")
assert best.fun < 0.25 * 100 * single.mean()
assert same < len(losses)

# %%
figure, axes = plt.subplots(figsize=(8, 3.2))
for values, label, style in (
    (bare, "bare glass", "k:"),
    (single, f"{quarter:.0f} nm of MgF2", "C0--"),
    (spectrum(best.x), "three layers", "C1-"),
):
    axes.plot(band, 100 * values, style, label=label)
axes.set(xlabel="wavelength (nm)", ylabel="reflectance (%)", ylim=(0, None))
axes.legend()
plt.show()

# %% [markdown]
# The three layers reflect less than a quarter of what one reflects. Some starts end in worse designs:
# without other starts one would not know.
#
# At the minimum all three slopes are zero, so a small error of a layer costs little: how much, says a
# layer that is 5 nm too thick.

# %%
print("slopes at the minimum (% per nm):", np.round(loss(best.x)[1], 5))
for i, name in enumerate(("MgF2", "HfO2", "Al2O3")):
    print(f"{name:5} 5 nm too thick: {loss(best.x + 5.0 * np.eye(3)[i])[0] - best.fun:+.3f} %")
assert np.all(np.abs(loss(best.x)[1]) < 1e-3)

# %% [markdown]
# ## What an instrument can see
#
# Take a film of 80 nm on silicon with an index of 1.8 + 0.02i, and let its thickness d, n and k all be
# unknown. A measured number y with noise of standard deviation σ tells about them as much as it depends
# on them. The *Fisher information* of all measured numbers is the matrix F = Σ (∂y/∂p)(∂y/∂p)ᵀ / σ², with
# p = (d, n, k). No unbiased estimate has standard deviations below the square roots of the diagonal of
# F⁻¹, the *Cramér-Rao bound*. So one can judge an instrument before it is built, and an experiment before
# it is done. All it takes are derivatives.
#
# ### Which angles?
#
# A laser ellipsometer measures two numbers, Ψ and Δ, at one wavelength, here 633 nm, with 0.02° of noise
# in Ψ and 0.05° in Δ.

# %%
TRUTH = jnp.array([80.0, 1.8, 0.02])
NOISE = np.array([0.02, 0.05])  # degrees of Ψ and Δ
angles = np.arange(45.0, 86.0, 1.0)


def psi_delta(p, wavelength, angle, substrate):
    """Ψ and Δ of the film in degrees, (points, 2)."""
    found = pl.ellipsometry(wavelength, p[0], p[1] + 1j * p[2], substrate, angle=angle)
    return jnp.stack(found, axis=-1)


@jax.jit
def angle_information(wavelength, angle, substrate):
    """What Ψ and Δ tell of d, n and k over their noise, (points, 2, 3)."""
    return jax.jacfwd(psi_delta)(TRUTH, wavelength, angle, substrate) / NOISE[:, None]


def bound(information):
    """The least standard deviations of d (nm), n and k."""
    return np.sqrt(np.diag(np.linalg.inv(information)))


weighted = np.asarray(
    angle_information(np.full(angles.size, 633.0), angles, np.full(angles.size, 3.87 + 0.015j))
)
information = np.einsum("ayp,ayq->apq", weighted, weighted)  # of each angle, (angles, 3, 3)

rank = np.linalg.matrix_rank(weighted)
print(f"rank of what one angle tells: {rank.min()} to {rank.max()}, of 3 unknowns")
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
bar = figure.colorbar(image, ax=axes, label="least standard deviation of thickness (nm)")
bar.set_ticks([-0.5, 0, 0.5, 1, 1.5], labels=["0.3", "1", "3", "10", "30"])
plt.show()

# %% [markdown]
# One angle gives two numbers, which cannot settle three unknowns, however small the noise: their
# derivatives have rank two. Two angles can. Neighbouring ones say nearly the same thing twice; the best
# pair lies far apart (red cross).

# %% [markdown]
# ### Which wavelengths?
#
# A spectrometer at normal incidence measures R from 400 to 800 nm with a noise of 0.002. Here we take n
# and k as the same at all wavelengths. With three unknowns three wavelengths are the least. We choose the
# best three on a grid of 10 nm, and go on adding whichever wavelength lowers the bound on the thickness
# most.

# %%
nm = np.linspace(400.0, 800.0, 41 if SHORT else 201)
WAFER = pl.refractive_index(nm, "Si")
R_NOISE = 0.002

slopes = jax.jit(jax.jacfwd(lambda p: pl.reflectance(nm, p[0], p[1] + 1j * p[2], WAFER)))(TRUTH)
each = np.einsum("wp,wq->wpq", slopes, slopes) / R_NOISE**2  # information of each wavelength


def errors_of(chosen):
    """Bounds for each of many sets of wavelengths, (sets, 3); infinite where they do not settle p."""
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
below.set(xlabel="number of wavelengths", ylabel="least error of d (nm)", ylim=(0, None))
below.legend()
plt.show()

places = np.unique(chosen)
told = ", ".join(f"{nm[i]:.0f}" for i in places)
print(f"{len(chosen)} measurements at {places.size} different wavelengths: {told} nm")
assert places.size < len(chosen)

# %% [markdown]
# For the same number of points the chosen wavelengths do better. The choice returns to a few places and
# measures there again and again: where a film acts as three curves, a few places tell them apart best.
# But it relies on n and k being the same everywhere. A real film's index varies with the wavelength, and
# a real spectrum warns of a wrong model, so measure more places than this, but spend the time where it
# counts.

# %% [markdown]
# ### Which instrument?
#
# The same film in three instruments, over the same wavelengths.

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
# Ellipsometry is far ahead, as people who measure nanometres know: Δ is a phase, and follows the
# thickness even where intensities hardly change.
#
# ## Does a fit reach the bound?
#
# The bound holds for every method. So we simulate noisy spectra at normal incidence, fit them without
# knowing d, n and k, and compare: the error that the fit states, and how the answers scatter.

# %%
# each Free holds a value, which is simulated, and bounds; a fit scans all between these
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
stated = np.array([[fit[name].stderr for name in NAMES] for fit in near])
print(f"           bound    stated   scatter of {len(near)} fits near 80 nm")
for i, name in enumerate(NAMES):
    least = limits["R at 0°"][i]
    print(f"{name:9}  {least:.5f}  {np.median(stated[:, i]):.5f}  {np.std(answers[:, i], ddof=1):.5f}")
assert np.allclose(np.median(stated, axis=0), limits["R at 0°"], rtol=0.15)

far = [fit for fit, is_near in zip(fits, there, strict=True) if not is_near]
told = [f"{fit['thickness'].value:.1f} nm ({fit.status})" for fit in far]
print(f"{len(far)} of {len(fits)} fits lie elsewhere: {', '.join(told) or 'none'}")
rival = min(fits[0].rivals, key=lambda rival: rival.delta_chi2)
thinner = rival.parameters
print(f"the nearest rival of the first fit: {thinner['thickness']:.1f} nm, n {thinner['n']:.2f}")
assert thinner["thickness"] < 80
assert thinner["n"] > 1.8
assert all(fit.status == "ambiguous" for fit in far)

# %% [markdown]
# The errors that a fit states are the bound, within what differs from one noisy spectrum to the next, and
# the answers scatter by about as much. But the bound looks at one answer and its neighbourhood only. This
# film has a rival: a thinner one with a higher index. Once in a while noise makes that one fit best. A
# fit says so by its status (`ambiguous`); the bound cannot. Notebook 6 goes on from here.
