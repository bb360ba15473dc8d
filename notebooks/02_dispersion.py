# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Index of an unknown film
#
# The thickness of a film comes out of its spectrum if its index n + ik is known. Often it is not: deposited
# films differ from tables, and tables from each other. Then both must come from one spectrum. That works if
# the index is described by few enough numbers. This page tries the usual descriptions, on a film of titania
# whose truth we know, and shows what each of them buys and costs.

# %%
import os

import jax
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl
from pellicle.recipes.media_words import medium

jax.config.update("jax_enable_x64", True)  # JAX counts in single precision unless told
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer points, for a quick run

# %% [markdown]
# ## Which titania?
#
# The catalogue has three tables of TiO2 films. They were grown in different ways, and differ by much more
# than the fit of a spectrum can bear.

# %%
nm = np.arange(340, 801, 4 if SHORT else 2)
tables = {"Siefke": "TiO2", "SOPRA TIO2": "TiO2/TIO2", "SOPRA TIO2B": "TiO2/TIO2B"}

figure, panels = plt.subplots(1, 2, figsize=(9, 3.5))
for word, name in tables.items():
    index = pl.refractive_index(nm, name)
    panels[0].plot(nm, index.real, label=word)
    panels[1].plot(nm, index.imag, label=word)
panels[0].set(xlabel="wavelength (nm)", ylabel="refractive index n")
panels[1].set(xlabel="wavelength (nm)", ylabel="extinction k")
panels[0].legend()
plt.show()

# %% [markdown]
# Our film has the index of the first table and 180 nm of it lie on fused silica. We simulate its
# reflectance with a noise of 0.002. From here on the fits do not know where it came from.

# %%
TRUTH = 180.0  # nm
spectrum = pl.simulate(pl.Scene(pl.Layer("TiO2", TRUTH), "SiO2"), nm, noise=0.002, seed=2)

figure, axes = plt.subplots(figsize=(6.5, 3.2))
axes.plot(spectrum.wavelength, spectrum.values, ".", color="k", markersize=3)
axes.set(xlabel="wavelength (nm)", ylabel="reflectance")
plt.show()

# %% [markdown]
# ## Five descriptions
#
# `medium` takes a word and gives a dispersion with sensible bounds for what is free in it:
#
# - **a table**: nothing is free but the thickness. We try the two wrong ones.
# - **`cauchy`**, n = A + B/λ²: two numbers, for media that do not absorb.
# - **`tauc-lorentz`**: an amorphous semiconductor with a gap, five numbers. Its k is zero below the gap,
#   and its n follows from its k by the relation of Kramers and Kronig, which holds for everything that
#   cannot answer before it is asked. That relation is why absorption in the ultraviolet shows in n
#   throughout the visible.
# - **`spline`**: no physics but smoothness. n and k are free at each of six wavelengths, twelve numbers in
#   all.
#
# `pl.compare` fits each of them to the same data and asks which the data call for. The judge is BIC, which
# is the misfit plus a price for each free number.

# %%
thickness = pl.Free(10, 1000)
media = {
    "SOPRA TIO2": "TiO2/TIO2",
    "SOPRA TIO2B": "TiO2/TIO2B",
    "cauchy": medium("cauchy"),
    "tauc-lorentz": medium("tauc-lorentz"),
    "spline": medium("spline(340,365,400,450,580,800)"),
}
scenes = {word: pl.Scene(pl.Layer(medium, thickness), "SiO2") for word, medium in media.items()}
comparison = pl.compare(spectrum, scenes)
fits = {c.name: c.fit for c in comparison.candidates}
print(comparison)

# %%
print(f"{'':14}{'free':>5}{'thickness (nm)':>18}{'off by (σ)':>12}{'reduced χ²':>12}   status")
for word, fit in fits.items():
    d = fit["thickness"]
    told = f"{d.value:.2f} ± {d.stderr:.2f}"
    off = (d.value - TRUTH) / d.stderr
    print(f"{word:14}{len(fit.free):5}{told:>18}{off:12.1f}{fit.chi2_reduced:12.1f}   {fit.status}")

# %% [markdown]
# χ² is the mean square of the residuals in units of the noise, so a right description has about 1. Three
# are far from it, and their fits say `misfit`: their thicknesses are not to be used, however small the
# error bars beside them. An error bar says how far the number could move *within* the description; it knows
# nothing of a description that is wrong. Look at the residuals:

# %%
figure, panels = plt.subplots(len(fits), 1, figsize=(7, 8), sharex=True)
for axes, (word, fit) in zip(panels, fits.items(), strict=True):
    axes.plot(nm, fit.curve.residual / fit.curve.sigma, ".", color="k", markersize=3)
    axes.axhline(0, color="C1", linewidth=0.8)
    axes.set_title(word, loc="left", fontsize="medium")
figure.supylabel("residual (σ)")
panels[-1].set(xlabel="wavelength (nm)")
plt.show()

# %% [markdown]
# Residuals that run in waves are no noise: the scene lacks something. Note the scale of each panel. Even
# the last two wave a little at the blue end, where k rises fast; that is why their χ² stays somewhat above
# 1, and their error bars are a little too small.
#
# ## Oscillator against spline
#
# The two descriptions that explain the spectrum find nearly the same index, and nearly the one that was put
# in:

# %%
truth = pl.refractive_index(nm, "TiO2")
figure, panels = plt.subplots(1, 2, figsize=(9.5, 3.8))
for part, axes in zip("nk", panels, strict=True):
    for word, colour in (("spline", "C0"), ("tauc-lorentz", "C1")):
        index = fits[word].index
        value, error = getattr(index, part), getattr(index, f"{part}_stderr")
        axes.plot(nm, value, color=colour, label=word)
        axes.fill_between(nm, value - 2 * error, value + 2 * error, color=colour, alpha=0.25, linewidth=0)
    axes.plot(nm, truth.real if part == "n" else truth.imag, "k:", label="truth")
    axes.set(xlabel="wavelength (nm)")
panels[0].set(ylabel="refractive index n")
panels[1].set(ylabel="extinction k", ylim=(-0.08, 0.25))
panels[0].legend(title="bands: two standard errors")
plt.show()

print("standard error of n, mean over the spectrum, and error against the truth:")
for word in ("tauc-lorentz", "spline"):
    index = fits[word].index
    off = np.sqrt(np.mean((index.n - truth.real) ** 2))
    print(f"  {word:14}{index.n_stderr.mean():8.4f}{off:8.4f}")

# %% [markdown]
# The spline is much less sure: where the film is transparent, a little more k here and a little less there
# changes nothing that the noise does not cover. (k is never negative in the fit; the band is only the error
# bar's width.) The oscillator knows that k is zero below the gap and that n must suit k; that knowledge is
# worth as much as many more measurements. The price: if the film were not of its kind, it would be wrong
# and the spline would not. That is what the comparison is for.
#
# What the oscillator's numbers mean for the material:

# %%
gap = fits["tauc-lorentz"]["Eg"]
print(f"gap {gap.value:.3f} ± {gap.stderr:.3f} eV, which is light of {1239.84 / gap.value:.0f} nm")

# %% [markdown]
# ## The Cauchy formula where it holds
#
# Cauchy's formula failed because the film absorbs at the blue end. Cut the spectrum where it is
# transparent, and two numbers are enough:

# %%
visible = spectrum.cut(450, 800)
fit = pl.fit(visible, scenes["cauchy"])
print(fit)
print(f"reduced χ² {fit.chi2_reduced:.2f}")

# %% [markdown]
# ## What to take away
#
# - A table is a guess at your film. Its fit may have a tiny error bar and be wrong; `misfit` and the
#   residuals say so.
# - Use the simplest description that the residuals allow: a formula on the transparent part, an oscillator
#   across an absorption edge.
# - A spline is the honest answer where nothing is known. Its wide band shows how much the others owe to
#   their assumptions.
# - `pl.compare` tells which of *your* ideas the data prefer. It cannot tell you the one you did not have.
