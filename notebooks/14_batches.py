# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A batch of wafers
#
# Many files of one kind: 12 oxidised wafers whose thickness should lie between 295 and 305 nm. This notebook
# makes one table of all fits, decides which wafers pass by their 95 % errors, and finds the files that should
# not be used. The last section does the same by one command, which goes on where it was interrupted.
#
# The spectra are simulated, so that the true thickness is known; two files have the flaws of real batches.

# %%
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import jax
import matplotlib.pyplot as plt
import numpy as np
import pandas

import pellicle as pl
from pellicle.errors import DataError

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer wafers, for a quick run

# %% [markdown]
# ## The files
#
# Each wafer has a file. Wafer 3 was measured off its film, on bare silicon, and of the file of wafer 4 only
# the header was saved.

# %%
random = np.random.default_rng(0)
folder = Path(tempfile.mkdtemp()) / "wafers"
folder.mkdir()
count = 6 if SHORT else 12
true = pandas.Series(300 + random.uniform(-12, 12, count), [f"wafer_{i}" for i in range(1, count + 1)])
true["wafer_3"] = 0.0
nm = np.arange(400.0, 801.0, 5.0)
for name, thickness in true.items():
    reflectance = np.asarray(pl.reflectance(nm, thickness, "SiO2", "Si"))
    measured = reflectance + 0.002 * random.standard_normal(len(nm))
    rows = "".join(f"{x:g},{y:.5f}\n" for x, y in zip(nm, measured, strict=True))
    (folder / f"{name}.csv").write_text("wavelength_nm,R\n" + rows)
(folder / "wafer_4.csv").write_text("wavelength_nm,R\n")
true.round(1)

# %% [markdown]
# ## One scene for all
#
# The scene is described once. A file that cannot be read raises `DataError`, whose message says where and
# what; it must not end the batch. Later fits take a fraction of the time of the first ones: programs are
# compiled when they pay.

# %%
scene = pl.Scene(pl.Layer("SiO2", pl.Free(100, 1000)), "Si")
fits, refused = {}, {}
for path in sorted(folder.glob("*.csv")):
    try:
        fits[path.stem] = pl.fit(pl.read_spectrum(path, noise=0.002), scene)
    except DataError as error:
        refused[path.stem] = str(error).replace(f"{folder}{os.sep}", "")
print(*refused.values(), sep="\n")

# %% [markdown]
# ## One table
#
# `fit.to_dataframe()` has a row for each parameter: value, standard error, the part of it that is noise, and
# the half width of the 95 % interval, `expanded`. Stacked, they are the table of the batch.

# %%
every = pandas.concat({name: fit.to_dataframe() for name, fit in fits.items()}, names=["wafer", "parameter"])
table = every.xs("thickness", level="parameter")[["value", "stderr_noise", "stderr", "expanded"]]
table["status"] = {name: str(fit.status) for name, fit in fits.items()}
table.round(3)

# %% [markdown]
# The status finds wafer 3: bare silicon is no film of at least 100 nm. Its number must not enter the
# statistics.

# %%
used = table[table["status"] == "converged"]
missed = used["value"] - true[used.index]
print(f"{len(used)} wafers: {used['value'].mean():.2f} nm in the mean, spread {used['value'].std():.2f} nm")
print(f"largest error {missed.abs().max():.2f} nm; each 95 % error is {used['expanded'].mean():.2f} nm")

# %% [markdown]
# ## Against a specification
#
# A wafer passes where its whole 95 % interval lies within the limits, fails where it lies outside, and is
# undecided where the interval contains a limit (the guard band of ISO 14253-1).

# %%
low, high = 295.0, 305.0
bottom, top = used["value"] - used["expanded"], used["value"] + used["expanded"]
decision = pandas.Series("undecided", used.index)
decision[(bottom >= low) & (top <= high)] = "pass"
decision[(top < low) | (bottom > high)] = "fail"
print(decision.value_counts().to_string())

figure, panel = plt.subplots(figsize=(7, 3.5))
colours = {"pass": "C2", "fail": "C3", "undecided": "C1"}
for name, choice in decision.items():
    value, error = used.loc[name, ["value", "expanded"]]
    panel.errorbar(name, value, error, fmt="o", color=colours[choice], capsize=3)
panel.axhspan(low, high, color="C2", alpha=0.1)
panel.set(ylabel="thickness (nm), 95 %")
panel.tick_params(axis="x", rotation=60)
plt.show()

# %% [markdown]
# ## The same by a command
#
# `pellicle fit FOLDER --spec thickness=295:305 --out DIR` writes `summary.csv`, which spreadsheets open, a
# page with a figure, and a folder for each file. Its exit code is 6 where a wafer fails, 3 where a file
# cannot be read; the largest counts. Run again, it fits files that are new or have changed, and no others.

# %%
film = ["--layer", "SiO2", "--substrate", "Si", "--thickness", "100:1000", "--noise", "0.002"]
limits, out = ["--spec", "thickness=295:305"], ["--out", str(folder.parent / "fits")]
command = [sys.executable, "-m", "pellicle", "fit", str(folder), *film, *limits, *out]
ran = subprocess.run(command, capture_output=True, text=True)
print(ran.stdout.replace(f"{folder}{os.sep}", ""), f"exit code {ran.returncode}")
summary = pandas.read_csv(folder.parent / "fits" / "summary.csv")
summary[[name for name in summary.columns if "thickness" in name or name == "status"]]

# %% [markdown]
# ## Where to go on
#
# The how-to page "Fit many files" has all options of the command. Many points of one wafer are a map, and a
# film that changes with time is a series: both have tutorials of their own.
