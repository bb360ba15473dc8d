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
# The spectrum of a film determines its thickness if its index n + ik is known. Often it is not: deposited
# films differ from tables, and tables differ from each other. Then one spectrum has to determine both,
# which is possible if few parameters describe the index. This notebook compares the usual models, on a
# simulated film of titania whose true index is known, and shows the advantages and disadvantages of each.

# %%
import os

import jax
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl
from pellicle.recipes.media import medium

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer points, for a quick run

# %% [markdown]
# ## Tables of titania
#
# The catalogue has three tables of TiO2 films. The films were grown by different methods, and their indices
# differ by much more than a fit of a spectrum tolerates.

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
# Our film has the index of the first table and lies on fused silica with a thickness of 180 nm. We simulate
# its reflectance with a noise of 0.002. The fits below do not use this knowledge.

# %%
TRUTH = 180.0  # nm
spectrum = pl.simulate(pl.Scene(pl.Layer("TiO2", TRUTH), "SiO2"), nm, noise=0.002, seed=2)

figure, axes = plt.subplots(figsize=(6.5, 3.2))
axes.plot(spectrum.wavelength, spectrum.values, ".", color="k", markersize=3)
axes.set(xlabel="wavelength (nm)", ylabel="reflectance")
plt.show()

# %% [markdown]
# ## Five models
#
# `medium` takes a name and returns a dispersion model with default bounds for its free parameters:
#
# - **a table**: only the thickness is free. We try the two wrong tables.
# - **`cauchy`**, n = A + B/λ²: two parameters, for media that do not absorb.
# - **`tauc-lorentz`**: an amorphous semiconductor with a band gap, five parameters. Its k is zero below the
#   gap, and its n follows from its k by the Kramers-Kronig relation, which holds for every causal response.
#   Because of this relation, absorption in the ultraviolet affects n throughout the visible.
# - **`spline`**: no physics except smoothness. n and k are free at each of six wavelengths, twelve
#   parameters in total.
#
# `pl.compare` fits each of them to the same data and ranks them by their evidence Z: the likelihood, averaged
# over the bounds of the free parameters, so that a model pays for numbers that it does not need.

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
print(f"{'':14}{'free':>5}{'thickness (nm)':>18}{'error (σ)':>12}{'reduced χ²':>12}   status")
for word, fit in fits.items():
    d = fit["thickness"]
    result = f"{d.value:.2f} ± {d.stderr:.2f}"
    off = (d.value - TRUTH) / d.stderr
    print(f"{word:14}{len(fit.free):5}{result:>18}{off:12.1f}{fit.chi2_reduced:12.1f}   {fit.status}")

# %% [markdown]
# The reduced χ² is the mean square of the residuals in units of the noise, so a correct model has about 1.
# Three models are far from it, and their fits have the status `misfit`: their thicknesses must not be used,
# however small their errors. An error bar describes how far the value can move *within* the model; it does
# not include the error of a wrong model. The residuals show this:

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
# Residuals with smooth structure are not noise: the scene lacks an effect. Note the scale of each panel.
# Even the last two have some structure at the blue end, where k rises fast; therefore their χ² is somewhat
# above 1, and their errors are a little too small.
#
# ## Oscillator and spline
#
# The two models that explain the spectrum find nearly the same index, close to the true one:

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
# The spline is much less certain: where the film is transparent, small changes of k that compensate each
# other change the spectrum by less than the noise. (k is never negative in the fit; the band only shows the
# error.) The oscillator model assumes that k is zero below the gap and that n follows from k; this prior
# knowledge reduces the error as much as many additional measurements would. If the film were not of this
# kind, however, the oscillator model would be wrong and the spline would not. The comparison is there to
# detect this.
#
# The parameters of the oscillator have a meaning for the material:

# %%
gap = fits["tauc-lorentz"]["Eg"]
print(f"gap {gap.value:.3f} ± {gap.stderr:.3f} eV, which is light of {1239.84 / gap.value:.0f} nm")

# %% [markdown]
# ## The Cauchy formula in its range of validity
#
# Cauchy's formula failed because the film absorbs at the blue end. In the range where the film is
# transparent, two parameters are sufficient:

# %%
visible = spectrum.cut(450, 800)
fit = pl.fit(visible, scenes["cauchy"])
print(fit)
print(f"reduced χ² {fit.chi2_reduced:.2f}")

# %% [markdown]
# ## Summary
#
# - A table is an assumption about your film. Its fit can have a very small error and be wrong; the status
#   `misfit` and the residuals show this.
# - Use the simplest model that the residuals allow: a formula in the transparent range, an oscillator
#   across an absorption edge.
# - Use a spline if nothing is known about the film. Its wide band shows how much the other models depend on
#   their assumptions.
# - `pl.compare` ranks the models that you offer. It cannot suggest one that you did not include.
