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
# The reflectance of 140 nm of hematite on glass (simulated, with noise) and the thickness that explains it.

# %%
import os

import jax
import matplotlib.pyplot as plt

import pellicle as pl

jax.config.update("jax_enable_x64", True)  # JAX counts in single precision unless told
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # the tests' smaller sizes

# %%
spectrum = pl.read_spectrum("../measurements/hematite_on_glass_140nm.csv")
scene = pl.Scene(pl.Layer("Fe2O3", thickness=pl.Free(lower=1, upper=1000)), substrate="BK7")
print(pl.fit(spectrum, scene))

# %%
figure, axes = plt.subplots()
axes.plot(spectrum.wavelength, spectrum.values, ".")
axes.set(xlabel="wavelength (nm)", ylabel="R")
plt.show()
