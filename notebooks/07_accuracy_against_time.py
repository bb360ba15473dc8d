# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Accuracy against time
#
# A layer can be computed by many methods. A complete calculation includes every effect and takes the most
# time; a faster one neglects effects that are small. Which effects matter depends on the scene: for a soap
# film a single reflection is nearly sufficient, for a film on metal it has a large error. This notebook
# shows
#
# 1. the *plan*: which effects pellicle computes for a scene, which it leaves out, and why;
# 2. the *methods* of computing the same spectrum, each with its error and its time;
# 3. the same for colours.
#
# Errors are properties of the scene and are the same on every machine. Times are those of the machine that
# executed this page, which may have been busy.

# %%
import os
import time

import jax
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

import pellicle as pl
from pellicle.colour import delta_e2000, film_colour, lab

jax.config.update("jax_enable_x64", True)  # double precision; JAX's default is single
SHORT = os.environ.get("PELLICLE_SHORT") == "1"  # fewer points, for a quick run

# %% [markdown]
# ## Three scenes
#
# The scenes are a soap film in air, whose fringes are slightly damped by a spectrometer with a bandwidth of
# 2 nm; hematite (iron oxide) on glass; and black copper oxide on aluminium at 60°. In each the thickness is
# unknown within bounds.

# %%
step = 10.0 if SHORT else 2.0
film = np.arange(510, 910 + step / 2, step)
visible = np.arange(420, 780 + step / 2, step)
scenes = {
    "soap film": pl.Scene(
        pl.Layer(pl.dispersion.Cauchy(1.332, 3100.0), pl.Free(100, 3000)),
        "air",
        light=pl.Light(film),
        instrument=pl.Instrument(bandwidth=2.0),
    ),
    "hematite on glass": pl.Scene(pl.Layer("Fe2O3", pl.Free(1, 1000)), "BK7", light=pl.Light(visible)),
    "CuO on aluminium": pl.Scene(pl.Layer("CuO", pl.Free(1, 300)), "Al", light=pl.Light(visible, angle=60.0)),
}

# %% [markdown]
# ## The plan
#
# `pl.plan` determines the effects of a scene from its contents and from the bounds of its free parameters,
# never from their current values. Without a tolerance it leaves out only effects that are absent, and these
# take no time:

# %%
plans = {name: pl.plan(scene) for name, scene in scenes.items()}
print(f"{'':13}" + "".join(f"{name:>19}" for name in scenes))
for row in plans["soap film"].rows:
    cells = ("computed" if plan.on(row.effect) else "-" for plan in plans.values())
    print(f"{row.effect:13}" + "".join(f"{cell:>19}" for cell in cells))
assert not plans["soap film"].on("absorption")
assert plans["CuO on aluminium"].on("polarisation")

# %% [markdown]
# The soap film absorbs nothing, and at normal incidence s and p are the same. *Coherence* is the damping of
# fringes by the bandwidth, *orders* the number of round trips in the film that are computed, *precision*
# the use of 16 digits instead of 7.
#
# With a tolerance, here 0.001 of R, the plan also leaves out effects that change the signal by less than
# that everywhere between the bounds, and gives the reasons:

# %%
TOLERANCE = 1e-3
spare = pl.plan(scenes["soap film"], TOLERANCE)
print(spare)
print(f"\nerror of at most {spare.error_bound:.1e} in R")
assert spare.error_bound <= TOLERANCE
assert not spare.on("precision")

# %% [markdown]
# ## Methods and their errors
#
# `pl.cost` computes a scene with every applicable method. It draws random values of the free parameters
# between their bounds and reports the largest error relative to the complete calculation, and the median
# time per spectrum. (The command `pellicle cost` does the same for a recipe. With `datasets=20` it also
# compares solvers on fits of simulated spectra.)

# %%
comparisons = {
    name: pl.cost(scene, tolerance=TOLERANCE, datasets=0).methods for name, scene in scenes.items()
}
for name, comparison in comparisons.items():
    print(f"{name}: {comparison.wavelengths} wavelengths, {comparison.draws} draws")
    for method in comparison.results:
        star = "*" if method.pareto else " "
        columns = f"{method.name:22} {method.error:8.1e}  {method.seconds * 1e6:7.2f} µs"
        print(f"  {star} {columns}   leaves out {method.leaves_out}")
    print(f"  the fastest within {TOLERANCE:g}: {comparison.recommended}\n")

# %%
LEAST = 1e-9  # smaller errors are drawn at this value


def plain_ticks(axis):
    """Label a logarithmic axis with 1, 2, 5 and so on."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


figure, panels = plt.subplots(3, 1, figsize=(9, 11))
for at, (name, comparison) in zip(panels, comparisons.items(), strict=True):
    for method in comparison.results:
        place = (method.seconds * 1e6, max(method.error, LEAST))
        look = {"color": "C1" if method.pareto else "0.5"}
        at.plot(*place, "o", markersize=4, **look)
        at.annotate(
            method.name, place, xytext=(3, 3), textcoords="offset points", rotation=30, fontsize=7, **look
        )
    at.axhline(TOLERANCE, color="C0", linestyle=":")
    at.set(xscale="log", yscale="log", ylim=(0.3 * LEAST, 100), ylabel="largest error in R")
    at.set_title(name, loc="left")
    plain_ticks(at.xaxis)
    at.margins(x=0.15)
panels[-1].set_xlabel("time of one spectrum (µs)")
plt.show()

# %% [markdown]
# Orange methods are Pareto optimal: no other method is both faster and more accurate. The dotted line is
# the tolerance. Errors below 1e-9 are drawn at that value, including the complete calculation (*float64*),
# whose error is zero by definition.

# %%
errors = {
    name: {method.name: method.error for method in comparison.results}
    for name, comparison in comparisons.items()
}
shown = ("incoherent", "constant index", "transparent layer", "closed form", "float32")
print(f"{'largest error in R':22}" + "".join(f"{name:>19}" for name in errors))
for method in shown:
    row = (f"{errors[name][method]:.1e}" if method in errors[name] else "-" for name in errors)
    print(f"{method:22}" + "".join(f"{cell:>19}" for cell in row))
for name in errors:
    assert errors[name]["incoherent"] > 10 * TOLERANCE
    assert errors[name]["constant index"] > 10 * TOLERANCE
    assert errors[name]["float32"] < 0.01 * TOLERANCE
assert errors["soap film"]["closed form"] < TOLERANCE

# %% [markdown]
# Which effects can be neglected?
#
# - **Interference** (*incoherent*): never for films this thin, because it causes their colours.
# - **Dispersion** (*constant index*: that of the middle of the spectrum): never at this tolerance.
# - **The bandwidth** of the soap film's spectrometer: yes; without it there is a closed formula.
# - **Double precision** (*float32*): yes, in all three.
#
# ## How many reflections?
#
# Light that enters a layer is reflected back and forth in it. The reflectance is a series over these round
# trips, its *orders*. Each order is weaker than the previous one by the reflectances of the two faces and
# the absorption of the layer. Renderers often keep one or two.

# %%
orders = {"1 order": 1, "2 orders": 2, "3 orders": 3, "5 orders": 5, "8 orders": 8}
figure, axes = plt.subplots(figsize=(7, 3.6))
needed = {}
for (name, method_errors), style in zip(errors.items(), ("C0o-", "C2s-", "C1D-"), strict=True):
    kept = {method: count for method, count in orders.items() if method in method_errors}
    axes.plot(list(kept.values()), [method_errors[method] for method in kept], style, label=name)
    needed[name] = next((count for method, count in kept.items() if method_errors[method] <= TOLERANCE), None)
    enough = needed[name] or "more than 8"
    one_order = method_errors["1 order"]
    print(f"{name}: error of one order {one_order:.1e}; orders needed for {TOLERANCE:g}: {enough}")
axes.axhline(TOLERANCE, color="k", linestyle=":", label="tolerance")
axes.set(yscale="log", xlabel="orders kept", ylabel="largest error in R")
axes.legend()
plt.show()
assert errors["soap film"]["1 order"] < TOLERANCE < errors["CuO on aluminium"]["3 orders"]
assert needed["CuO on aluminium"] is None
assert errors["hematite on glass"]["1 order"] > 10 * errors["soap film"]["1 order"]

# %% [markdown]
# Water reflects little, so one order is sufficient for the soap film. Hematite reflects more. Copper oxide
# on aluminium is bounded by a strongly reflecting metal and a face at 60°, and eight orders are not
# sufficient: there the closed formula, which sums all orders, is exact and no slower. (The errors of the
# soap film reach a plateau: with a bandwidth, the remaining error is that of the damping in the series.)
#
# ## Colours
#
# A renderer needs three values instead of a spectrum. An exact integral over the sensitivity of the eye
# requires many wavelengths. `film_colour` has several faster methods:
#
# - `points-650-510-475`: three wavelengths for red, green and blue, as in many shaders;
# - `belcour-barla`: four Gaussians and three orders, as published by Belcour and Barla (2017);
# - `gaussians-N`: the same with N Gaussians of our own, and six orders;
# - `nodes-N-D`: N wavelengths chosen for films up to D nm;
# - `uniform-N`: N evenly spaced wavelengths.
#
# The errors are colour differences ΔE2000, of which 1 is just visible, relative to a step of 1 nm. The
# films: transparent, index 1.33 to 2.4, on glass and on a metal, 0 to 1000 nm thick, at several angles.

# %%
random = np.random.default_rng(0)
COUNT = 1000 if SHORT else 8000
thickness, angle = random.uniform(0, 1000, COUNT), random.uniform(0, 80, COUNT)
index = random.uniform(1.33, 2.4, COUNT)
base = np.where(random.random(COUNT) < 0.5, 1.5, 2.7 + 2.8j)
METHODS = (
    "points-650-510-475",
    "belcour-barla",
    "gaussians-4",
    "gaussians-8",
    "nodes-8-1000",
    "uniform-16",
    "uniform-64",
)


def program(method):
    """Return a compiled function for the XYZ of films under D65."""
    return jax.jit(lambda d, n, b, t: film_colour(d, n, b, angle=t, method=method).xyz)


def to_lab(xyz):
    """Return L*, a*, b* relative to the white of D65."""
    return np.asarray(lab(np.asarray(xyz, float), white))


white = film_colour(0.0, 1.0, 1.0).white
truth = to_lab(program("uniform-351")(thickness, index, base, angle))
single = [x.astype(np.float32) for x in (thickness, index)] + [
    base.astype(np.complex64),
    angle.astype(np.float32),
]
table = {}
for method in METHODS:
    run = program(method)
    error = delta_e2000(to_lab(run(*single)), truth)
    taken = []
    for _ in range(20):
        began = time.perf_counter()
        run(*single).block_until_ready()
        taken.append(time.perf_counter() - began)
    table[method] = (
        float(np.mean(error)),
        float(np.percentile(error, 95)),
        float(np.median(taken)) / COUNT * 1e9,
    )
print(f"{'method':20} mean ΔE2000   95 % below   ns per colour")
for method, (mean, most, ns) in table.items():
    print(f"{method:20} {mean:11.3f} {most:12.2f} {ns:15.0f}")

# %%
figure, axes = plt.subplots(figsize=(7, 4))
for method, (mean, _, ns) in table.items():
    axes.plot(ns, mean, "o", color="C1" if method.startswith("gaussians") else "0.4")
    axes.annotate(method, (ns, mean), xytext=(5, 3), textcoords="offset points", fontsize="small")
axes.axhline(1.0, color="C0", linestyle=":", label="just visible")
axes.set(xscale="log", yscale="log", xlabel="time of one colour (ns)", ylabel="mean ΔE2000")
plain_ticks(axes.xaxis)
axes.margins(x=0.25)
axes.legend(loc="upper right")
plt.show()
mean = {method: row[0] for method, row in table.items()}
assert mean["points-650-510-475"] > 5 * mean["belcour-barla"] > 5
assert mean["gaussians-8"] < 0.2 < mean["gaussians-4"]
assert mean["uniform-16"] > 5 * mean["gaussians-8"]

# %% [markdown]
# Three wavelengths give wrong colours. The error of the published Gaussians is just visible when two
# colours are side by side; that of our eight is not. Twice as many evenly spaced wavelengths have a larger
# error: the fringes of thick films are narrower than their steps, whereas a Gaussian includes the damping
# of the fringes. Sixty-four evenly spaced wavelengths have the smallest error, and on a processor that
# computes many values at once they need not be slow: compare the times above.
