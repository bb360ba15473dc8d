# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # An unknown film
#
# A wafer comes with a reflectance spectrum and a guess: "some nitride or oxide, a hundred or two hundred
# nanometres". `pellicle.identify` takes the file and the substrate, and says which films the data leave.
# Where several are left, `pellicle.plan_measurement` says what to measure next.
#
# The data are simulated here, so that the answer can be checked: 150 nm of silicon nitride, on silicon with a
# native oxide of 2 nm.

# %%
import os
import tempfile
from pathlib import Path

import jax
import matplotlib.pyplot as plt
import numpy as np

import pellicle as pl

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer angles and rivals, for a quick run

# %% [markdown]
# ## The file

# %%
truth = [pl.Layer("Si3N4", 150.0), pl.Layer("SiO2", 2.0)]
nm = np.linspace(400.0, 800.0, 101)
folder = Path(tempfile.mkdtemp())
pl.write_spectrum(folder / "wafer.csv", pl.simulate(pl.Scene(truth, "Si"), nm, noise=0.003, seed=1))

spectrum = pl.read_spectrum(folder / "wafer.csv")
plt.plot(spectrum.wavelength, spectrum.values, ".")
plt.xlabel("wavelength (nm)")
plt.ylabel("reflectance")
plt.show()

# %% [markdown]
# ## Which film?

# %%
found = pl.identify(spectrum, "Si")
print(found)

# %% [markdown]
# The curves of all films that are left lie on the data. What differs in their residuals is no more than the
# usual errors of a lamp and of tables of n. The lowest panel has the evidence of everything that was tried:
# from 5 on, odds of 150 to 1, a film is excluded.

# %%
found.plot()

# %% [markdown]
# The wafer has one film in all of them. A thickness that is given without the material must contain them all:

# %%
for film in found.hypotheses:
    (low, high), own = film.layers[0].n, film.layers[0].thickness
    about = f"n {low:.2f} to {high:.2f}  {own.value:.1f} ± {own.stderr:.1f} nm"
    print(f"{film.name:8} {film.probability:4.2f}  {about}")

# %% [markdown]
# ## What to measure next
#
# The films that are left are simulated with the usual noise, and each is fitted to the data of the others.
# Δ ln Z is the evidence that a measurement would give.

# %%
rivals = {film.name: film.scene() for film in found.hypotheses[: 2 if SHORT else 3]}
angles = [0.0, 70.0] if SHORT else [0.0, 55.0, 65.0, 70.0, 75.0]
plan = pl.plan_measurement(
    rivals, nm, signals=["R", "psi-delta"], angles=angles, polarisations=["unpolarised"]
)
print(plan.verdict)

# %% [markdown]
# Another reflectance would not help, and one spectrum of Ψ and Δ would. So this is measured, at the
# angle that the plan names, with errors of 0.05° and 0.1°.

# %%
scene = pl.Scene(truth, "Si", light=pl.Light(angle=70.0, signal="psi-delta"))
ellipsometer = pl.simulate(scene, nm, noise=0.05, seed=2)
both = pl.identify([spectrum, ellipsometer], "Si")
print(both)

# %% [markdown]
# ## The number
#
# Both files together leave one film. Its scene is what a fit takes: the fit repeats the search, checks the
# residuals and lists what the error is made of.

# %%
fit = pl.fit([spectrum, ellipsometer], both.best.scene())
print(fit)
print(f"true thickness of the nitride: {truth[0].thickness} nm")

# %%
fit.plot()

# %% [markdown]
# The native oxide is in no hypothesis. It is one of the systematic effects that the evidence and the errors
# contain, as are 1 % of the index, the angle, roughness and contamination. The thickness of the nitride may
# contain a part of it.
#
# The same at the command:
#
# ```bash
# pellicle identify wafer.csv --substrate Si --next --out first
# pellicle identify wafer.csv ellipsometer.csv --substrate Si --out both
# pellicle fit --recipe both/1.toml
# ```
