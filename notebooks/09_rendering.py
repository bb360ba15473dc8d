# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # From a fit to a rendering
#
# A film is fitted to a spectrum, exported to the renderer Mitsuba 3, and drawn on a sphere. Mitsuba has no
# model of thin films, so `pellicle export` writes tables of the exact colours. How far from these are the
# formulas with which other renderers draw such films?
#
# The renderings need the package `mitsuba` (`pip install 'pellicle[render]'`); without it they are left out.

# %%
import importlib.util
import os
import sys
import tempfile
from pathlib import Path

import jax
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl
from pellicle.colour import delta_e2000, lab, sensor, srgb
from pellicle.rendering import gltf as gltf_formula
from pellicle.rendering.appearance import ANGLES, appearance

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # smaller renderings, for a quick run
MITSUBA = importlib.util.find_spec("mitsuba") is not None
FOLDER = Path(tempfile.mkdtemp())

# %% [markdown]
# ## The film
#
# Steel heated in air grows an oxide. We simulate the reflectance of a blue one, and fit its thickness.

# %%
STEEL = 2.7 + 2.8j
truth = pl.Scene(pl.Layer(2.9, 43.0), STEEL, light=pl.Light(wavelength=np.linspace(400, 800, 128)))
spectrum = pl.simulate(truth, noise=0.003, seed=1)
fit = pl.fit(spectrum, pl.Scene(pl.Layer(2.9, pl.Free(5, 150)), STEEL))
print(fit["thickness"])

# %% [markdown]
# ## Files for Mitsuba
#
# `pl.export` takes the fit. The `.bsdf` files are tables for Mitsuba's own `measured` material: one in RGB,
# one spectral. The `.npz` has the colour against thickness and angle, for the BSDF in Python that is written
# beside it. The scenes show a sphere.

# %%
written = pl.export(fit, to="mitsuba", path=FOLDER / "steel.xml")
for path in written.files:
    print(f"{path.name:22s} {path.stat().st_size / 1e6:6.2f} MB")

# %% [markdown]
# A `.bsdf` file can be read like any other file of BRDF samples, those of the RGL material database too.

# %%
samples = pl.read_brdf_samples(FOLDER / "steel.bsdf", samples=2000, max_theta=75)
print(samples)
for note in samples.notes:
    print("-", note)

# %% [markdown]
# ## The rendering
#
# Left: the tables. Middle: the lookup, whose thickness may vary over the object; here it grows from 5 nm at
# one pole to 50 nm at the other. Right: the same film by the formula that glTF publishes for its extension
# `KHR_materials_iridescence`, with the film's own index and thickness.


# %%
def sphere(material):
    """The scene with this material."""
    size, samples = (40, 16) if SHORT else (200, 64)
    look = mi.ScalarTransform4f().look_at([0, -4.2, 0.8], [0, 0, 0], [0, 0, 1])
    to_side = mi.ScalarTransform4f().look_at([-3, -3, 4], [0, 0, 0], [0, 0, 1]).scale(1.5)
    scene = {
        "type": "scene",
        "integrator": {"type": "direct"},
        "sensor": {
            "type": "perspective",
            "fov": 30,
            "to_world": look,
            "film": {"type": "hdrfilm", "width": size, "height": size},
        },
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 0.6}},
        "lamp": {
            "type": "rectangle",
            "to_world": to_side,
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 6.0}},
        },
        "sphere": {"type": "sphere", "material": material},
    }
    return np.asarray(mi.render(mi.load_dict(scene), spp=samples), float)


look = appearance(truth)
numbers = gltf_formula.physical(look)
if MITSUBA:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")  # llvm_ad_rgb is far faster where LLVM is installed
    mi.set_log_level(mi.LogLevel.Error)
    sys.path.insert(0, str(FOLDER))
    import pellicle_film

    pellicle_film.register()
    ramp = {"type": "bitmap", "raw": True, "filename": str(FOLDER / "ramp.png")}
    plt.imsave(FOLDER / "ramp.png", np.linspace(0, 1, 64)[:, None] * np.ones(4), cmap="gray", vmin=0, vmax=1)
    uneven = {"thickness": ramp, "thickness_min": 5.0, "thickness_max": 50.0, "alpha": 0.1}
    with np.load(FOLDER / "steel.npz") as table:
        arrays = dict(table)
    thicknesses, cosines, _ = arrays["rgb"].shape
    nm = np.linspace(*arrays["thickness"], thicknesses)[:, None]
    gltf = gltf_formula.colour(numbers, nm, np.linspace(0, 1, cosines) ** 2)
    np.savez(FOLDER / "gltf.npz", **(arrays | {"rgb": np.asarray(gltf, np.float32)}))
    renderings = {"43 nm, tables": sphere({"type": "measured", "filename": str(FOLDER / "steel.bsdf")})}
    for name, table in (("5 to 50 nm, lookup", "steel.npz"), ("5 to 50 nm, glTF's formula", "gltf.npz")):
        renderings[name] = sphere({"type": "pellicle_film", "filename": str(FOLDER / table), **uneven})
    figure, panels = plt.subplots(1, 3, figsize=(9, 3.2))
    for axes, (name, rendering) in zip(panels, renderings.items(), strict=True):
        axes.imshow(np.asarray(srgb(rendering)), origin="upper")
        axes.set_title(name)
        axes.axis("off")
    plt.show()
else:
    print("mitsuba is not installed")

# %% [markdown]
# ## The error of a formula
#
# ΔE2000 of about 1 is just visible, and one of 10 is another colour. The error of the formula is measured
# from the exact colours at each angle. `pellicle export --to gltf` states it, and solves for other numbers
# with which the formula comes closer.

# %%
white = sensor().white
numbers_of_film = gltf_formula.GLTF.xyz(numbers, look.thickness)
difference = delta_e2000(lab(np.asarray(numbers_of_film)[0], white), lab(look.xyz[0], white))
figure, axes = plt.subplots(figsize=(6, 3))
axes.plot(ANGLES, difference)
axes.set(xlabel="angle of incidence (°)", ylabel="ΔE2000 of glTF's formula", ylim=(0, None))
plt.show()
print(f"mean {difference.mean():.1f}, largest {difference.max():.1f}")
