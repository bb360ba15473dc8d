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
# Hematite, the red of ochre, absorbs blue light and lets red light through. A layer of it that is thinner
# than a wavelength therefore shows two things at once: the colour of the pigment, and the interference of
# the light from its two faces. Gerardin, Holzschuch and Martinetto (2019) render such layers. Here we draw
# their figures from pellicle's model, then go the other way: from a spectrum, or from a colour alone, to
# the thickness.

# %%
import os

import jax
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl
from pellicle.colour import delta_e2000, film_colour, lab, sensor

jax.config.update("jax_enable_x64", True)  # JAX counts in single precision unless told
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer points, for a quick run

# %% [markdown]
# ## What the pigments do to light
#
# A material is a complex refractive index n + ik at each wavelength. n slows the wave down; k, the
# extinction, takes it away: over a wavelength λ of path its power falls by exp(−4πk). Both come from
# published tables, which pellicle carries with their sources.

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
# Gold absorbs everywhere. The two pigments are semiconductors: they absorb where a photon has the energy to
# lift an electron, in the blue and green, and hardly at all in the red.
#
# ## From thickness to spectrum and colour
#
# `pl.reflectance` takes wavelengths and thicknesses in nanometres, the layer and what lies under it. Its
# arguments broadcast like NumPy's: a column of thicknesses against a row of wavelengths gives a map.
# `film_colour` adds the spectrum up as the eye does, under daylight (D65) unless told otherwise. This is
# Figure 1 of the paper, hematite on glass.

# %%
thickness = np.linspace(0, 300, 76 if SHORT else 301)
hematite, glass = pl.material("Fe2O3"), pl.material("BK7")
maps = {
    "reflectance": pl.reflectance(nm, thickness[:, None], hematite, glass),
    "transmittance": pl.transmittance(nm, thickness[:, None], hematite, glass),
}
colours = film_colour(thickness, hematite, glass, way="uniform-64")

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
# In the red the map has fringes: thicknesses that reflect much and little in turn, because the light of the
# two faces comes back in step or out of step. In the blue the light does not survive the way to the lower
# face and back, so there is one face, and no fringes. The colour of the reflected light (the strip) runs
# through the hues again and again, paler each time.
#
# Figure 4 compares gold with cadmium sulfide, from a few atoms to a fiftieth of a millimetre.

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
# Gold is opaque from about 100 nm on and shows no fringes at all. Cadmium sulfide shows them, and lets red
# light through however thick it is here. What passes no layer can tell nothing of its lower face: we shall
# meet that again below.
#
# ## From spectrum to thickness
#
# `measurements/` holds simulated spectra of these layers, with noise and with the truth in their headers. A
# *scene* says what is there; what is to be found stands in it as `pl.Free`, with bounds. The fit looks at
# the whole range between them, because interference gives the misfit many minima.

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
misfit.semilogy(fit.profile.thickness, fit.profile.delta_chi2, label="what the search saw")
misfit.semilogy(
    [r.parameters["thickness"] for r in fit.rivals],
    [r.delta_chi2 for r in fit.rivals],
    "v",
    label="bottom of another valley",
)
misfit.axvline(fit["thickness"].value, color="k", linestyle=":", label="the best")
misfit.set(xlabel="thickness (nm)", ylabel="χ² above the best")
misfit.legend(ncols=3, loc="upper right", fontsize="small")
misfit.set_ylim(top=2e7)
plt.show()

print("other minima:", ", ".join(f"{r.parameters['thickness']:.0f} nm" for r in fit.rivals[:4]))

# %% [markdown]
# The residuals are noise, without a pattern. The lowest panel shows why the whole range must be searched: a
# fit that starts in the wrong valley ends at its bottom. Here the other valleys lie far above the best, so
# the spectrum decides. Where one came close, the fit would say `ambiguous`.
#
# The error bar holds for what the scene takes for granted: here, that the sample's index is the table's. If
# n and k may be off by a constant (`pl.dispersion.Shifted`), the same spectrum says less:

# %%
shifted = pl.dispersion.Shifted(hematite, pl.Free(-0.5, 0.5, start=0.0), pl.Free(0.0, 1.0, start=0.0))
freer = pl.fit(spectrum, pl.Scene(pl.Layer(shifted, pl.Free(1, 1000)), glass))
print(freer)
print(f"error of the thickness: {freer['thickness'].stderr / fit['thickness'].stderr:.1f} times as large")

# %% [markdown]
# Cadmium sulfide and gold go the same way. (These spectra were simulated with another table of cadmium
# sulfide, the catalogue's `CdS`, which absorbs a little more; so it is the one to fit with.)

# %%
for name, material in (
    ("cds_on_glass_80nm", "CdS"),
    ("cds_on_glass_250nm", "CdS"),
    ("cds_on_glass_600nm", "CdS"),
    ("gold_on_glass_300nm", "Au"),
):
    measured = pl.read_spectrum(f"../measurements/{name}.csv")
    found = pl.fit(measured, pl.Scene(pl.Layer(material, pl.Free(1, 2000)), glass))
    print(f"{name}: {found.status}. {found.verdict}")

# %% [markdown]
# No light comes back from under 300 nm of gold. The data say that the layer is thick and no more, so the
# answer is a lower limit in place of a value with an error bar.
#
# ## From colour alone
#
# A photograph or a colorimeter gives three numbers instead of a spectrum. How much do they still say? We
# compute the colour of the hematite spectrum and compare it with that of every thickness, as ΔE (CIE 2000):
# below about 1 two colours cannot be told apart side by side; a camera is seldom better than 2 or 3.

# %%
eye = sensor()  # the 1931 observer under D65
xyz = np.interp(eye.wavelength, spectrum.wavelength, spectrum.values) @ eye.weights
seen = lab(xyz, eye.white)
fine = np.linspace(1, 300, 300 if SHORT else 1200)
candidates = film_colour(fine, hematite, glass, way="uniform-64")
apart = delta_e2000(candidates.lab, seen)

figure, (axes, strip) = plt.subplots(
    2, 1, figsize=(7, 4.2), sharex=True, gridspec_kw={"height_ratios": [6, 1]}
)
axes.plot(fine, apart)
axes.axhspan(0, 3, color="C5", alpha=0.25, linewidth=0, label="ΔE below 3: a photograph cannot tell")
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
    print(f"  nearest there: {fine[inside][np.argmin(apart[inside])]:.0f} nm, ΔE {apart[inside].min():.1f}")

# %% [markdown]
# Two layers, of which one is more than twice as thick as the other, have nearly this colour: three numbers
# cannot count the orders of interference. Only a good instrument under a known lamp tells them apart; or
# something known from elsewhere that rules one out. Within each range the colour fixes the thickness to a
# few nanometres. (The small steps of the curve are the formula's own, where two hues are opposite.) The
# spectrum has no such doubt:

# %%
at = [r[np.argmin(np.interp(r, fine, apart))] for r in ranges]
figure, axes = plt.subplots(figsize=(6.5, 3.5))
axes.plot(spectrum.wavelength, spectrum.values, ".", color="k", markersize=3, label="data")
for d, line in zip(at, ("--", "-"), strict=True):
    swatch = np.asarray(film_colour(d, hematite, glass, way="uniform-64").srgb)
    axes.plot(
        nm,
        pl.reflectance(nm, d, hematite, glass),
        color=swatch,
        linewidth=3,
        linestyle=line,
        label=f"{d:.0f} nm",
    )
axes.set(xlabel="wavelength (nm)", ylabel="reflectance", xlim=(400, 700))
axes.legend(title="each in its own colour")
plt.show()

# %% [markdown]
# ## What to take away
#
# - A scene with one free number, a spectrum and `pl.fit` give a thickness with an error, or say why they
#   cannot.
# - An error bar is only as good as what the scene takes for granted. Free what you are not sure of, and see
#   it grow.
# - Colour alone narrows the thickness to a few short ranges; a spectrum says which.
# - A layer that no light crosses has no thickness for an optical measurement, only a lower limit.
