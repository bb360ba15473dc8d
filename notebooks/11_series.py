# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A film that dries
#
# A spectrometer watches a polymer film lose its solvent: one spectrum every two seconds. Each spectrum can be
# fitted alone, but the film is one film. Its thickness goes on from time to time, and its lamp and window
# are the same at all times. `pellicle.series` fits all spectra together.
#
# The spectra are simulated here, with flaws of real instruments, so that the true thickness is known.

# %%
import os

import jax
import matplotlib.pyplot as plt
import numpy as np
import xarray

import pellicle as pl

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer spectra, for a quick run

# %% [markdown]
# ## The run
#
# A film of 2 µm shrinks to 900 nm, quickly at first. The spectrometer sees a narrow band, 620 to 680 nm, with
# noise of 0.02: a single spectrum has several thicknesses that explain it about as well. A window in front
# of the film transmits up to 1 % more or less along the band.

# %%
random = np.random.default_rng(0)
time = np.arange(0.0, 600.0, 10.0 if SHORT else 2.0)  # s
nm = np.linspace(620.0, 680.0, 40)
true = 900 + 1100 * np.exp(-time / 200)
rate = -1100 / 200 * np.exp(-time / 200) * 60  # nm/min

clean = np.asarray(pl.reflectance(nm, true[:, None], 1.46, 3.9))
window = 1 + 0.01 * np.sin(2 * np.pi * (nm - 620) / 60)
spectra = clean * window + 0.02 * random.standard_normal(clean.shape)
axes = {"time": ("time", time, {"units": "s"}), "wavelength": ("wavelength", nm, {"units": "nm"})}
run = xarray.Dataset({"R": (("time", "wavelength"), spectra)}, axes)

figure, panel = plt.subplots(figsize=(7, 3.5))
image = panel.pcolormesh(time, nm, spectra.T, shading="nearest")
panel.set(xlabel="time (s)", ylabel="wavelength (nm)")
figure.colorbar(image, label="reflectance")
plt.show()

# %% [markdown]
# ## All spectra together
#
# A scene is that of a single spectrum. A free thickness varies slowly, and all other free numbers would be
# the same at all times.

# %%
scene = pl.Scene(pl.Layer(1.46, pl.Free(0, 3000)), 3.9)
film = pl.series(run, scene)
print(pl.report(film))

# %% [markdown]
# Each spectrum has first been fitted alone (`film.map`), with all its minima. The path through these minima
# that changes most evenly decides the order of interference; a smoother then joins all times.

# %%
alone = film.map["thickness"]
figure, panels = plt.subplots(2, 1, figsize=(7, 5), sharex=True)
panels[0].plot(time, alone, ".", color="0.6", label="each spectrum alone")
panels[0].plot(time, film["thickness"], label="all together")
panels[0].set(ylabel="thickness (nm)")
panels[0].legend()
away, error = film["thickness"] - true, 1.96 * film["thickness_stderr"]
panels[1].fill_between(time, -error, error, alpha=0.2, label="95 %")
panels[1].plot(time, away, label="distance from the truth")
panels[1].set(xlabel="time (s)", ylabel="nm")
panels[1].legend()
plt.show()


# %%
def rms(x):
    return float(np.sqrt(np.nanmean(np.asarray(x) ** 2)))


print(f"alone {rms(alone - true):.2g} nm, together {rms(away):.2g} nm (rms)")
print(f"alone, another order: {np.mean(np.abs(alone - true) > 50):.1%} of the times")
print(f"rate: {rms(film['rate'] - rate):.2g} nm/min (rms)")

# %% [markdown]
# ## The window
#
# What stays is the window: it is no noise, and all times share it. The fringes of a film that dries move
# across the band, and the window does not, so the data tell them apart.

# %%
cleaned = pl.series(run, scene, lamp_curve="joint")
better = cleaned["thickness"] - true
print(f"with the lamp curve {rms(better):.2g} nm, rate {rms(cleaned['rate'] - rate):.2g} nm/min (rms)")
print(*cleaned.map.notes, sep="\n")

# %% [markdown]
# ## What the errors mean
#
# `thickness_stderr_noise` is the error by noise: of changes from time to time. `thickness_stderr` adds what
# all times have in common, such as the error of an index that is taken from a table: of a thickness.
# `rate_stderr` contains what these do to a rate.

# %%
for name, off in (("thickness", better), ("rate", cleaned["rate"] - rate)):
    inside = np.mean(np.abs(off) < 1.96 * cleaned[f"{name}_stderr"])
    print(f"{name}: {float(inside):.0%} within 95 % errors")

# %% [markdown]
# The same at the command, for a folder with a file for each time (`film_020s.csv`):
#
# ```bash
# pellicle series spectra --recipe film.toml --lamp-curve joint --out dried
# ```
#
# While the film dries, `pellicle watch spectra --recipe film.toml --out live` fits each file as it arrives.
