# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Thickness of a pigment layer
#
# Hematite, the pigment of red ochre, absorbs blue light and transmits red light. A layer that is thinner
# than a wavelength therefore shows two effects: the colour of the pigment, and the interference of the
# light from its two faces. Gerardin, Holzschuch and Martinetto (2019) render such layers. This notebook
# reproduces their figures with pellicle's model. It then determines the thickness from a spectrum, and from
# a colour alone.

# %%
import os

import jax
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl
from pellicle.colour import delta_e2000, film_colour, lab, sensor

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer points, for a quick run

# %% [markdown]
# ## Refractive indices of the pigments
#
# A material has a complex refractive index n + ik at each wavelength. n reduces the phase velocity of the
# wave; k, the extinction coefficient, attenuates it: over a path of one wavelength λ its power falls by
# exp(−4πk). Both are taken from published tables, which pellicle contains with their sources.

# %%
nm = np.linspace(400, 700, 301)
pigments = {"hematite": "Fe2O3", "cadmium sulfide": "main/CdS/Treharne", "gold": "Au"}

figure, panels = plt.subplots(1, 2, figsize=(9, 3.5))
for word, name in pigments.items():
    index = pl.refractive_index(nm, name)
    panels[0].plot(nm, index.real, label=word)
    panels[1].plot(nm, index.imag, label=word)
panels[0].set(xlabel="wavelength (nm)", ylabel="refractive index n", ylim=(0, 4))
panels[1].set(xlabel="wavelength (nm)", ylabel="extinction k", ylim=(0, 4))
panels[0].legend()
plt.show()

for word, name in pigments.items():
    print(f"{word}: {pl.material(name).citation}")

# %% [markdown]
# Gold absorbs everywhere. The two pigments are semiconductors: they absorb photons whose energy is above
# their band gap, in the blue and green, and are nearly transparent in the red.
#
# ## From thickness to spectrum and colour
#
# `pl.reflectance` takes wavelengths and thicknesses in nanometres, the layer and the substrate. Its
# arguments broadcast as in NumPy: a column of thicknesses and a row of wavelengths give a map.
# `film_colour` integrates the spectrum with the sensitivity of the eye, by default under daylight (D65).
# This is Figure 1 of the paper, hematite on glass.

# %%
thickness = np.linspace(0, 300, 76 if SHORT else 301)
hematite, glass = pl.material("Fe2O3"), pl.material("BK7")
maps = {
    "reflectance": pl.reflectance(nm, thickness[:, None], hematite, glass),
    "transmittance": pl.transmittance(nm, thickness[:, None], hematite, glass),
}
colours = film_colour(thickness, hematite, glass, method="uniform-64")

figure, (strip, *panels) = plt.subplots(
    1, 3, figsize=(10, 3.8), sharey=True, gridspec_kw={"width_ratios": [0.6, 5, 5]}
)
strip.imshow(np.asarray(colours.srgb)[:, None], extent=(0, 1, 0, 300))
strip.set(xticks=[], xlabel="colour", ylabel="thickness (nm)")
for axes, (title, values) in zip(panels, maps.items(), strict=True):
    mesh = axes.pcolormesh(nm, thickness, values, vmin=0, vmax=1, rasterized=True)
    axes.set(xlabel="wavelength (nm)", title=title)
    figure.colorbar(mesh, ax=axes)
plt.show()

# %% [markdown]
# In the red the map has fringes: the reflectance rises and falls with thickness, because the light from the
# two faces returns in phase or out of phase. In the blue the light is absorbed before it returns from the
# lower face, so only one face reflects and there are no fringes. The colour of the reflected light (the
# strip) runs through the hues again and again, paler each time.
#
# Figure 4 compares gold with cadmium sulfide, for thicknesses from 1 nm to 20 µm.

# %%
grown = np.geomspace(1, 2e4, 100 if SHORT else 600)
red = np.linspace(500, 700, 101)
mean = {
    word: np.mean(pl.transmittance(red, grown[:, None], pigments[word], "BK7"), axis=1)
    for word in ("cadmium sulfide", "gold")
}

figure, axes = plt.subplots(figsize=(6, 3.5))
for (word, values), colour in zip(mean.items(), ("C1", "C2"), strict=True):
    axes.semilogx(grown, values, color=colour, label=word)
axes.set(xlabel="thickness (nm)", ylabel="transmittance, mean over 500-700 nm", ylim=(0, 1))
axes.legend()
plt.show()

for word in mean:
    print(f"{word}, 100 nm: {np.interp(100, grown, mean[word]):.1%} of the light passes")

# %% [markdown]
# Gold is opaque above about 100 nm and shows no fringes. Cadmium sulfide shows fringes, and transmits red
# light at every thickness in the figure. If no light crosses a layer, a measurement contains no information
# about its lower face: an example follows below.
#
# ## From spectrum to thickness
#
# `measurements/` contains simulated spectra of these layers, with noise and with the true values in their
# headers. A *scene* describes the sample; an unknown parameter is a `pl.Free` with bounds. The fit searches
# the whole range between the bounds, because interference gives the misfit many minima.

# %%
spectrum = pl.read_spectrum("../measurements/hematite_on_glass_140nm.csv")
scene = pl.Scene(pl.Layer(hematite, thickness=pl.Free(1, 1000)), substrate=glass)
fit = pl.fit(spectrum, scene)
print(fit)

# %%
curve = fit.curve
figure, (above, below, misfit) = plt.subplots(
    3, 1, figsize=(7, 7), gridspec_kw={"height_ratios": [3, 1.4, 2.4]}
)
above.plot(curve.wavelength, curve.data, ".", color="k", markersize=3, label="data")
above.plot(curve.wavelength, curve.model, color="C1", label=f"hematite, {fit['thickness'].value:.1f} nm")
above.set(ylabel="reflectance")
above.legend()
below.plot(curve.wavelength, curve.residual / curve.sigma, ".", color="k", markersize=3)
below.axhline(0, color="C1")
below.set(xlabel="wavelength (nm)", ylabel="residual (σ)")
misfit.semilogy(fit.profile.thickness, fit.profile.delta_chi2, label="scan")
misfit.semilogy(
    [r.parameters["thickness"] for r in fit.rivals],
    [r.delta_chi2 for r in fit.rivals],
    "v",
    label="other minima",
)
misfit.axvline(fit["thickness"].value, color="k", linestyle=":", label="best fit")
misfit.set(xlabel="thickness (nm)", ylabel="χ² above the best")
misfit.legend(ncols=3, loc="upper right", fontsize="small")
misfit.set_ylim(top=2e7)
plt.show()

print("other minima:", ", ".join(f"{r.parameters['thickness']:.0f} nm" for r in fit.rivals[:4]))

# %% [markdown]
# The residuals are noise without structure. The lowest panel shows why the whole range must be searched: a
# fit that starts near another minimum ends there. Here all other minima are far above the best one, so the
# spectrum determines the thickness. If one came close, the status would be `ambiguous`.
#
# The error bar is conditional on the assumptions of the scene: here, that the index of the sample equals
# the table. If n and k may differ from the table by a constant (`pl.dispersion.Shifted`), the same spectrum
# determines the thickness less precisely:

# %%
shifted = pl.dispersion.Shifted(hematite, pl.Free(-0.5, 0.5, start=0.0), pl.Free(0.0, 1.0, start=0.0))
freer = pl.fit(spectrum, pl.Scene(pl.Layer(shifted, pl.Free(1, 1000)), glass))
print(freer)
print(f"error of the thickness: {freer['thickness'].stderr / fit['thickness'].stderr:.1f} times as large")

# %% [markdown]
# Cadmium sulfide and gold are fitted in the same way. (These spectra were simulated with another table of
# cadmium sulfide, the catalogue's `CdS`, which absorbs a little more, so the fit uses that table.)

# %%
for name, material in (
    ("cds_on_glass_80nm", "CdS"),
    ("cds_on_glass_250nm", "CdS"),
    ("cds_on_glass_600nm", "CdS"),
    ("gold_on_glass_300nm", "Au"),
):
    measured = pl.read_spectrum(f"../measurements/{name}.csv")
    result = pl.fit(measured, pl.Scene(pl.Layer(material, pl.Free(1, 2000)), glass))
    print(f"{name}: {result.status}. {result.verdict}")

# %% [markdown]
# No light returns from below 300 nm of gold. The data determine only that the layer is thick, so the result
# is a lower limit instead of a value with an error bar.
#
# ## From colour alone
#
# A photograph or a colorimeter gives three numbers instead of a spectrum. How well do they determine the
# thickness? We compute the colour of the hematite spectrum and compare it with the colour of every
# thickness, as ΔE (CIE 2000): below about 1, two colours are indistinguishable side by side; a camera is
# seldom better than 2 or 3.

# %%
eye = sensor()  # the 1931 observer under D65
xyz = np.interp(eye.wavelength, spectrum.wavelength, spectrum.values) @ eye.weights
measured_lab = lab(xyz, eye.white)
fine = np.linspace(1, 300, 300 if SHORT else 1200)
candidates = film_colour(fine, hematite, glass, method="uniform-64")
apart = delta_e2000(candidates.lab, measured_lab)

figure, (axes, strip) = plt.subplots(
    2, 1, figsize=(7, 4.2), sharex=True, gridspec_kw={"height_ratios": [6, 1]}
)
axes.plot(fine, apart)
axes.axhspan(0, 3, color="C5", alpha=0.25, linewidth=0, label="ΔE below 3: indistinguishable in a photograph")
axes.set(ylabel="ΔE2000 from the measured colour", ylim=(0, 48))
axes.legend()
strip.imshow(np.asarray(candidates.srgb)[None], extent=(1, 300, 0, 1))
strip.set(xlabel="thickness (nm)", yticks=[])
plt.show()

close = fine[apart < 3]
ranges = np.split(close, np.flatnonzero(np.diff(close) > 2) + 1)
print("ΔE below 3:", " and ".join(f"{r[0]:.0f} to {r[-1]:.0f} nm" for r in ranges))
for r in ranges:
    inside = (fine >= r[0]) & (fine <= r[-1])
    print(f"  closest: {fine[inside][np.argmin(apart[inside])]:.0f} nm, ΔE {apart[inside].min():.1f}")

# %% [markdown]
# Two layers, one more than twice as thick as the other, have nearly this colour: three numbers do not
# determine the order of interference. Only a precise instrument under a known lamp can distinguish them, or
# prior knowledge that excludes one of them. Within each range the colour determines the thickness to a few
# nanometres. (The small steps of the curve are a property of the ΔE formula where two hues are opposite.)
# The spectrum distinguishes the two easily:

# %%
at = [r[np.argmin(np.interp(r, fine, apart))] for r in ranges]
figure, axes = plt.subplots(figsize=(6.5, 3.5))
axes.plot(spectrum.wavelength, spectrum.values, ".", color="k", markersize=3, label="data")
for d, line in zip(at, ("--", "-"), strict=True):
    swatch = np.asarray(film_colour(d, hematite, glass, method="uniform-64").srgb)
    axes.plot(
        nm,
        pl.reflectance(nm, d, hematite, glass),
        color=swatch,
        linewidth=3,
        linestyle=line,
        label=f"{d:.0f} nm",
    )
axes.set(xlabel="wavelength (nm)", ylabel="reflectance", xlim=(400, 700))
axes.legend(title="drawn in the colour of the film")
plt.show()

# %% [markdown]
# ## Summary
#
# - A scene with one free parameter, a spectrum and `pl.fit` give a thickness with an error, or the reason
#   why the data do not determine it.
# - An error bar is conditional on the assumptions of the scene. Free uncertain parameters, and the error
#   grows accordingly.
# - Colour alone restricts the thickness to a few short ranges; a spectrum selects one of them.
# - If no light crosses a layer, an optical measurement gives only a lower limit of its thickness.
