# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Tempered steel
#
# Polished steel that is heated in air grows an oxide of a few tens of nanometres, with colours that change
# from straw to purple to blue. Smiths estimate the temperature from them. The colours are due to
# interference, so they depend on the oxide's thickness. How precisely do they determine it? This notebook
# computes the thickness from the colour, examines where the result is not unique, and ends with a fit of a
# few BRDF samples, which contain more information than one colour.

# %%
import os
from dataclasses import replace

import jax
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl
from pellicle.colour import delta_e2000, film_colour, lab
from pellicle.reporting.renderings import display
from pellicle.simulation.surface_sphere import render

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer points, for a quick run

# %% [markdown]
# ## The sequence of colours
#
# We use the oxide and the iron of an account of Belcour and Barla: an oxide of index 2.9 on a metal of 2.7
# + 2.8i, both the same at all wavelengths. `film_colour` computes the colour under daylight (D65) for each
# thickness and angle of incidence.

# %%
OXIDE, STEEL = 2.9, 2.7 + 2.8j
nm = np.linspace(0, 80, 81 if SHORT else 321)
angle = np.linspace(0, 80, 21 if SHORT else 81)
colours_of_films = film_colour(nm, OXIDE, STEEL, angle=angle[:, None], method="uniform-64")

figure, axes = plt.subplots(figsize=(7, 3.6))
axes.imshow(np.asarray(colours_of_films.srgb), extent=(0, 80, 0, 80))
axes.set(xlabel="oxide thickness (nm)", ylabel="angle of incidence (°)")
plt.show()

# %% [markdown]
# Colour names refer to the hue. In the CIE L\*a\*b\* space (lightness, green to red, blue to yellow) yellow
# is near 90°, red near 30°, purple near 320° and blue near 260°. At which thicknesses does the hue at
# normal incidence pass through these?

# %%
a, b = np.asarray(colours_of_films.lab)[0, :, 1:].T
hue, chroma = np.rad2deg(np.arctan2(b, a)) % 360, np.hypot(a, b)
for name, low, high in (("straw", 60, 105), ("purple", 285, 345), ("blue", 235, 280)):
    inside = nm[(hue > low) & (hue < high) & (chroma > 10)]
    print(f"{name:7} {inside.min():3.0f} to {inside.max():3.0f} nm")

# %% [markdown]
# Straw, purple, blue: the sequence of the smiths, within 60 nm. The spectra show the reason:

# %%
light = np.linspace(400, 700, 151)
figure, axes = plt.subplots(figsize=(6.5, 3.4))
for name, d in (("straw", 20.0), ("purple", 31.0), ("blue", 42.0)):
    swatch = np.asarray(film_colour(d, OXIDE, STEEL, method="uniform-64").srgb)
    reflected = pl.reflectance(light, d, OXIDE, STEEL)
    axes.plot(light, reflected, color=swatch, linewidth=3, label=f"{name}, {d:.0f} nm")
    print(f"{name}: darkest at {light[np.argmin(reflected)]:.0f} nm, in the range 400 to 700 nm")
axes.set(xlabel="wavelength (nm)", ylabel="reflectance", ylim=(0, None))
axes.legend(title="drawn in the colour of the film")
plt.show()

# %% [markdown]
# At one wavelength the light from the two faces of the oxide nearly cancels. As the oxide grows, this
# wavelength moves from the violet to the red; the remaining light is yellow, then purple, then blue.
#
# ## Thickness from a heat tint
#
# A bar was heated at one end, where its oxide is thickest. We simulate a photograph of it, with noise
# equivalent to an error of about one in L\*, a\* and b\* of each patch. For each patch we find the
# thickness with the closest colour by ΔE (CIE 2000), in which about 1 is the smallest visible difference.

# %%
place = np.linspace(0, 100, 50 if SHORT else 200)  # mm from the cold end
oxide = 8 + 52 * (place / 100) ** 2  # nm
exact = np.asarray(film_colour(oxide, OXIDE, STEEL, method="uniform-64").lab)
photograph = exact + np.random.default_rng(5).normal(0, 1, exact.shape)

table = np.linspace(0, 70, 281)
colours = film_colour(table, OXIDE, STEEL, method="uniform-64")
apart = delta_e2000(photograph[:, None], np.asarray(colours.lab)[None])
read = table[np.argmin(apart, axis=1)]

figure, (bar, axes) = plt.subplots(2, 1, figsize=(7, 4), sharex=True, height_ratios=[1, 4])
bar.imshow(
    np.asarray(film_colour(oxide, OXIDE, STEEL, method="uniform-64").srgb)[None], extent=(0, 100, 0, 1)
)
bar.set(yticks=[], title="the bar")
axes.plot(place, oxide, "k", label="truth")
axes.plot(place, read, ".", label="read from the colour")
axes.set(xlabel="place on the bar (mm)", ylabel="oxide thickness (nm)")
axes.legend()
plt.show()

print(f"error of the readings: {np.sqrt(np.mean((read - oxide) ** 2)):.2f} nm root mean square")

# %% [markdown]
# The error of such a reading depends on how fast the colour changes with thickness. The inverse of this
# slope is the error of the thickness caused by an error of ΔE = 1:

# %%
step = 0.25
fine = np.arange(0, 70, step)
lab_of = np.asarray(film_colour(fine, OXIDE, STEEL, method="uniform-64").lab)
slope = delta_e2000(lab_of[1:], lab_of[:-1]) / step

figure, axes = plt.subplots(figsize=(7, 3))
axes.semilogy(fine[1:] - step / 2, 1 / slope)
axes.set(xlabel="oxide thickness (nm)", ylabel="error of the thickness\nfor ΔE = 1 (nm)")
plt.show()

best = np.argmax(slope)
print(f"best, at {fine[best]:.0f} nm: {1 / slope[best]:.2f} nm")
print(f"at 60 nm: {np.interp(60, fine[1:], 1 / slope):.1f} nm")

# %% [markdown]
# Between straw and purple the colour changes within a few nanometres, so the reading is precise; for pale
# blues and the first straw it is much less precise.
#
# ## Where the colour is not unique
#
# The colours recur as the oxide becomes thicker. The map compares each thickness up to 250 nm with every
# other: the diagonal compares a film with itself, and every other dark spot is a pair of similar colour. In
# the map on the right the lightness is ignored, as in a photograph of unknown exposure.

# %%
wide = np.arange(0, 250.5, 2.0 if SHORT else 1.0)
many = film_colour(wide, OXIDE, STEEL, method="uniform-64")
xyz = np.asarray(many.xyz)
exposed = np.asarray(lab(0.3 * xyz / xyz[:, 1:2], np.asarray(many.white)))
maps = {
    "colour": delta_e2000(np.asarray(many.lab)[:, None], np.asarray(many.lab)[None]),
    "colour without lightness": delta_e2000(exposed[:, None], exposed[None]),
}

figure, panels = plt.subplots(1, 2, figsize=(10, 4.4), sharey=True)
for axes, (title, apart) in zip(panels, maps.items(), strict=True):
    mesh = axes.imshow(apart, extent=(0, 250, 0, 250), vmin=0, vmax=15, cmap="magma", aspect="equal")
    axes.set(xlabel="thickness (nm)", title=title)
panels[0].set(ylabel="thickness (nm)")
figure.colorbar(mesh, ax=panels, label="ΔE2000")
plt.show()

far = np.abs(wide[:, None] - wide) > 20  # pairs that are not simply neighbours
for title, apart in maps.items():
    one, other = np.nonzero(np.triu(far & (apart < 3)))
    print(f"{title}: {len(one)} pairs below ΔE 3")
    for i in np.unique(np.round(wide[one] / 10)):
        group = np.flatnonzero(np.round(wide[one] / 10) == i)
        k = group[np.argmin(apart[one[group], other[group]])]
        print(f"    {wide[one[k]]:.0f} and {wide[other[k]]:.0f} nm: ΔE {apart[one[k], other[k]]:.1f}")

# %% [markdown]
# With lightness, colours of films below 90 nm hardly recur. Without it, many tints occur again in another
# order, at a thickness larger by ninety nanometres or more. Three measures help: a grey card beside the
# object for the exposure, a second angle, and prior knowledge of the object. A tempering oxide of 200 nm,
# for example, is not plausible.
#
# ## Which oxide?
#
# A colour determines the optical thickness of a film. To obtain nanometres, the index of the film must be
# known. The figure compares three pairs of oxide and metal: the one above, and measured tables of magnetite
# (Fe3O4) and of hematite (Fe2O3) on iron.

# %%
pairs = {
    "index 2.9 on 2.7 + 2.8i": (OXIDE, STEEL),
    "magnetite on iron": (pl.material("Fe3O4"), pl.material("Fe")),
    "hematite on iron": (pl.material("Fe2O3"), pl.material("Fe")),
}
thin = np.linspace(0, 80, 161)
figure, panels = plt.subplots(3, 1, figsize=(7, 3), sharex=True)
for axes, (name, (oxide, metal)) in zip(panels, pairs.items(), strict=True):
    tint = film_colour(thin, oxide, metal, method="uniform-64")
    axes.imshow(np.asarray(tint.srgb)[None], extent=(0, 80, 0, 1))
    axes.set(yticks=[])
    axes.set_title(name, loc="left", fontsize="small")
    darkest = thin[np.argmin(np.asarray(tint.lab)[:, 0])]
    print(f"{name}: darkest tint at {darkest:.0f} nm")
panels[-1].set(xlabel="oxide thickness (nm)")
plt.show()

# %% [markdown]
# The darkest tint, between straw and blue, occurs at quite different thicknesses. The index of the oxide is
# therefore the largest source of error, far above the error of the colour, unless it is known from another
# source or determined by a further measurement.
#
# ## Thickness and index from BRDF samples
#
# A polished and etched bar is rough. Its BRDF, the fraction of the light from one direction that is
# reflected into another, is that of small mirrors (GGX microfacets), each covered by the oxide. Twenty
# directions under each of three lamps, in red, green and blue with an error of 2 %, are sufficient to fit
# the thickness *and* the index of the oxide, with the roughness and two weights. The index of the iron is
# fixed.

# %%
truth = {"thickness": 42.0, "n": 2.9, "base_n": 2.7, "base_k": 2.8, "roughness": 0.35, "diffuse": 0.02}
lamps, each = (20.0, 40.0, 60.0), 20
across = np.tile(np.linspace(-70, 70, each), len(lamps))
directions = pl.Directions(
    theta_i=np.repeat(lamps, each),
    phi_i=np.zeros(across.size),
    theta_o=np.abs(across),
    phi_o=np.where(across > 0, 180.0, 0.0),
)
exact = pl.simulate(pl.Surface("microfacet-film", truth), directions=directions)
sigma = 0.02 * exact.values
noise = sigma * np.random.default_rng(3).standard_normal(sigma.shape)
samples = replace(exact, values=exact.values + noise, sigma=sigma)

unknown = {
    "thickness": pl.Free(0, 300),
    "n": pl.Free(1.5, 3.0),
    "roughness": pl.Free(0.003, 1),
    "specular": pl.Free(0, 100),
    "diffuse": pl.Free(0, 2),
}
fit = pl.fit(samples, pl.Surface("microfacet-film", truth | unknown))
print(fit)
print("other minima:", ", ".join(f"{r.parameters['thickness']:.0f} nm" for r in fit.rivals))

# %% [markdown]
# The fit recovers both thickness and index, and no other order fits. The two are correlated, as the report
# states, so each has a larger error than it would have with the other fixed.
#
# A rendered image of such a surface in a studio, with an uneven oxide of 10 to 70 nm:

# %%
uneven = pl.Surface("microfacet-film", truth | {"thickness": pl.Free(10, 70)})
image = render(uneven, size=50 if SHORT else 300)
figure, axes = plt.subplots(figsize=(3.6, 3.6))
axes.imshow(display(image), origin="upper")
axes.set_axis_off()
plt.show()

# %% [markdown]
# ## Summary
#
# - Straw, purple and blue are due to one dark fringe that moves through the spectrum, and all occur within
#   60 nm.
# - Between straw and blue a colour determines the thickness to a fraction of a nanometre; before and after
#   that, to a nanometre or more.
# - Without a known exposure most tints occur in two orders. Exclude orders by prior knowledge, or measure
#   at another angle.
# - The index of the oxide is the largest source of error. Several directions in three channels can
#   determine it too.
