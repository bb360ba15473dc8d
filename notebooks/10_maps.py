# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Maps of a soap film and of tempered steel
#
# A camera that measures a spectrum at each pixel delivers a cube: reflectance against position and
# wavelength. This notebook goes from two simulated cubes to maps of the thickness, and compares them with
# the truth: a soap film that drains, which is a series of images, and a gradient of oxide on steel.

# %%
import os

import jax
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import pellicle as pl
from pellicle.colour import film_colour, srgb
from pellicle.colour.spaces import into_srgb
from pellicle.fitting.batch.data import CODES

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer pixels, for a quick run
random = np.random.default_rng(0)
BANDS = np.arange(420.0, 781.0, 8.0)

# %% [markdown]
# ## A soap film that drains
#
# A vertical soap film is thicker below. Jeffreys (1930) gave the thickness of a draining film as
# d ∝ √(z/t), with z from the upper end. At the top the film collapses to a black film, which is thinner than
# the wavelength and reflects almost nothing.

# %%
DEPTH = np.linspace(0.5, 30.0, 20 if SHORT else 60)  # mm from the top
X = np.linspace(0.0, 12.0, 4 if SHORT else 24)  # mm
TIME = np.linspace(20.0, 80.0, 5 if SHORT else 13)  # s
WATER, BLACK = 1.34, 12.0

depth, seconds = DEPTH[:, None] + 0.4 * np.sin(X / 2), TIME[:, None, None]
soap = 750.0 * np.sqrt(depth / 30.0 * 20.0 / seconds)  # nm, (time, z, x)
front = 0.08 * TIME[:, None, None]  # mm: the lower end of the black film
soap = np.where(depth < front, BLACK, soap)

frames = [0, len(TIME) // 2, len(TIME) - 1]
figure, panels = plt.subplots(1, 3, figsize=(6, 4.2), sharey=True)
for axes, i in zip(panels, frames, strict=True):
    linear = 8 * np.asarray(film_colour(soap[i].ravel(), WATER, 1.0).linear_srgb)  # it reflects little
    shown = np.asarray(srgb(into_srgb(linear))).reshape(*soap[i].shape, 3)
    axes.imshow(shown, origin="upper", extent=(X[0], X[-1], DEPTH[-1], DEPTH[0]))
    axes.set(title=f"{TIME[i]:.0f} s", xlabel="x (mm)")
panels[0].set_ylabel("depth (mm)")
plt.show()

# %% [markdown]
# The cube is an `xarray.DataArray` with the axes time, y, x and wavelength, in any order. Units are
# attributes. The film is simulated by Airy's formula, written out in NumPy.


# %%
def airy(thickness, film, substrate):
    """Reflectance (..., bands) of a film in air, at normal incidence."""
    upper, lower = (1 - film) / (1 + film), (film - substrate) / (film + substrate)
    turn = np.exp(4j * np.pi * film * thickness[..., None] / BANDS)
    return np.abs((upper + lower * turn) / (1 + upper * lower * turn)) ** 2


SIGMA = 0.001  # of the reflectance
film_cube = xr.DataArray(
    airy(soap, WATER, 1.0) + random.normal(0, SIGMA, (*soap.shape, BANDS.size)),
    dims=("time", "y", "x", "wavelength"),
    coords={
        "time": ("time", TIME, {"units": "s"}),
        "y": ("y", 30.0 - DEPTH, {"units": "mm"}),  # upward
        "x": ("x", X, {"units": "mm"}),
        "wavelength": ("wavelength", BANDS, {"units": "nm"}),
    },
    name="reflectance",
    attrs={"units": "1"},
)
scene = pl.Scene(pl.Layer(WATER, pl.Free(5, 1500)), 1.0)
drained = pl.map(film_cube, scene, noise=SIGMA)
print(pl.report(drained))
drained.plot()
plt.show()

# %% [markdown]
# The map agrees with the truth where its status says so. The standard error combines noise and systematic
# effects: an index that is off by some thousandths changes all pixels together. The simulation has none of
# these effects, so the deviations must be compared with the error of the noise alone.


# %%
def compared(dataset, truth):
    """Print the shares of decided pixels within 1 and 2 standard errors, and return their deviations."""
    decided = np.isin(dataset["status"], [CODES["converged"], CODES["by-neighbours"]])
    deviation = np.where(decided, dataset["thickness"] - truth, np.nan)
    scaled = np.abs(deviation / dataset["thickness_stderr_noise"].values)[decided]
    print(f"{100 * decided.mean():.1f} % of {decided.size} pixels are decided; of these lie")
    for n, expected in ((1, 68.3), (2, 95.4)):
        print(f"  {100 * np.mean(scaled < n):.1f} % within {n} standard error (expected: {expected} %)")
    return deviation


maps = drained.dataset.compute()
deviation = compared(maps, soap)

# %% [markdown]
# The rate of drainage is the slope of each pixel's thickness against time. `growth` fits a line to the times
# around each one, here three; the law above makes the rate −d/(2t). Where the film collapses within these
# times, a line does not fit, and `thickness_rate_status` says so.

# %%
rates = drained.growth(window=3, unit="s")
middle = len(TIME) // 2
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4))
for i in frames:
    left.errorbar(
        DEPTH,
        maps["thickness"][i, :, 0],
        maps["thickness_stderr"][i, :, 0],
        fmt=".",
        label=f"{TIME[i]:.0f} s",
    )
    left.plot(DEPTH, soap[i, :, 0], color="black", linewidth=0.8)
left.set(xlabel="depth (mm)", ylabel="thickness (nm)")
left.legend()
right.plot(DEPTH, rates["thickness_rate"][middle, :, 0], ".", label="map")
wet = soap[middle, :, 0] > BLACK
right.plot(
    DEPTH[wet], (-soap[middle, :, 0] / (2 * TIME[middle]))[wet], color="black", linewidth=0.8, label="truth"
)
right.set(xlabel="depth (mm)", ylabel=f"rate at {TIME[middle]:.0f} s (nm/s)")
right.legend()
plt.show()

# %% [markdown]
# ## A gradient of oxide on steel
#
# A bar that was heated at one end has an oxide whose thickness grows along it; its colours are known as
# temper colours or heat tint. The simulated bar has a spot of grease with another
# spectrum. The camera's lamp is brighter in the middle, so each pixel has its own scale.

# %%
HEIGHT, LENGTH = (8, 24) if SHORT else (40, 160)
OXIDE, STEEL = 2.9, 2.7 + 2.8j
along, across = np.linspace(0.0, 80.0, LENGTH), np.linspace(0.0, 20.0, HEIGHT)  # mm
oxide = 10.0 + 60.0 / (1 + np.exp(-(along - 45.0) / 10.0)) + 1.5 * np.sin(across[:, None] / 4)  # nm
lamp = 1.0 - 0.15 * ((along - 40.0) / 40.0) ** 2
grease = np.hypot(along - 62.0, across[:, None] - 13.0) < 4.0
steel = airy(oxide, OXIDE, STEEL)
steel[grease] = 0.3 + 0.1 * np.sin(BANDS / 25.0)  # fringes of a thick layer that the scene does not have

steel_cube = xr.DataArray(
    steel * lamp[:, None] + random.normal(0, 0.002, steel.shape),
    dims=("y", "x", "wavelength"),
    coords={
        "y": ("y", across, {"units": "mm"}),
        "x": ("x", along, {"units": "mm"}),
        "wavelength": ("wavelength", BANDS, {"units": "nm"}),
    },
)
bar = pl.Scene(pl.Layer(OXIDE, pl.Free(1, 120)), STEEL, instrument=pl.Instrument(scale="free"))
tinted = pl.map(steel_cube, bar, noise=0.002)
print(pl.report(tinted))
tinted.plot()
plt.show()

# %%
tints = tinted.dataset.compute()
compared(tints, oxide)
row = HEIGHT // 2
figure, (top, axes) = plt.subplots(2, 1, figsize=(7, 4.2), sharex=True, height_ratios=[1, 2])
colours = into_srgb(np.asarray(film_colour(oxide.ravel(), OXIDE, STEEL).linear_srgb))
top.imshow(np.asarray(srgb(colours)).reshape(*oxide.shape, 3), extent=(0, 80, 0, 20))
top.set(ylabel="y (mm)", title="colours of the bar, without grease")
profile, doubtful = tints.isel(y=row), tints["status"][row].values == CODES["misfit"]
sure = profile.isel(x=~doubtful)
axes.errorbar(sure["x"], sure["thickness"], sure["thickness_stderr"], fmt=".", label="map")
axes.plot(along[doubtful], profile["thickness"][doubtful], "x", label="misfit: not to be used")
axes.plot(along, oxide[row], color="black", linewidth=0.8, label="truth")
axes.set(xlabel="x (mm)", ylabel=f"thickness at y = {across[row]:.0f} mm (nm)")
axes.legend()
plt.show()
