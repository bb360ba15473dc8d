"""Series of simulated films: orders, errors and coverage of thickness and rate, with flaws of real runs.

Run: `python benchmarks/series.py [--draws 10] [--only NAME] [--narrow]`. Spectra by the Airy formula in
NumPy, of a film that grows to 3 µm on an absorbing substrate, at 500 times, with noise of 1 % of the values.
Each draw has another film, noise and flaws. `single` are the fits of each spectrum alone. Coverage is that of
1.96 standard errors.

`--traces`: of lasers, 300 to 1000 times, two to eight fringes, with noise of 0.5 to 3 % of the range of the
light, gains and offsets that are not told, and the thickness at first, of one laser but in the last row.
"""

import argparse
import sys
from time import perf_counter, process_time

import numpy as np
import xarray

import pellicle as pl
from pellicle.fitting.batch.data import STATUSES

TIME = np.arange(500) * 2.0
SUBSTRATE = 3.9 + 0.02j
HALF_ORDER = 70.0
"""Distance (nm) beyond which an order is wrong, of 100 to 150 between minima."""


def reflectance(thickness, index, nm):
    """Spectra (times, wavelengths) of a layer at normal incidence."""
    upper, lower = (1 - index) / (1 + index), (index - np.conj(SUBSTRATE)) / (index + np.conj(SUBSTRATE))
    turn = np.exp(-4j * np.pi * index * thickness[:, None] / nm)
    return np.abs((upper + lower * turn) / (1 + upper * lower * turn)) ** 2


def slow(random, count=3):
    """A smooth curve of the time, of size 1."""
    at = TIME / TIME[-1]
    curve = sum(
        random.standard_normal() / k * np.sin(np.pi * k * at + random.uniform(0, 6))
        for k in range(1, count + 1)
    )
    return curve / np.abs(curve).max()


def lamp(random, nm):
    """A level that drifts by 2 % and a tilt that drifts by 1 %."""
    tilt = (nm - nm.mean()) / np.ptp(nm)
    return 1 + 0.02 * slow(random)[:, None] + 0.02 * slow(random)[:, None] * tilt


def window(random, nm):
    """A curve of 1 % that no time changes."""
    at = (nm - nm[0]) / np.ptp(nm)
    return 1 + 0.01 * np.sin(2 * np.pi * at * random.uniform(0.3, 1.5) + random.uniform(0, 6))


FLAWS = {
    "none": (),
    "lamp": ("lamp",),
    "level": ("level",),
    "window": ("window",),
    "index": ("index",),
    "wavelength": ("wavelength",),
    "all": ("lamp", "window", "index", "wavelength"),
}


def draw(random, nm, flaws):
    """True thickness and rate (nm/min), and the data."""
    top, pace = random.uniform(2500, 3000), random.uniform(300, 900)
    grown = top * (1 - np.exp(-TIME / pace)) / (1 - np.exp(-TIME[-1] / pace))
    rate = 60 * top / pace * np.exp(-TIME / pace) / (1 - np.exp(-TIME[-1] / pace))
    index = 1.46 + (0.003 * slow(random)[:, None] if "index" in flaws else 0.0)
    seen = nm + (random.normal(0, 0.3) if "wavelength" in flaws else 0.0)
    values = reflectance(grown, index, seen)
    values = values * (lamp(random, nm) if "lamp" in flaws else 1.0)
    values = values * (1 + 0.05 * slow(random)[:, None] if "level" in flaws else 1.0)
    values = values * (window(random, nm) if "window" in flaws else 1.0)
    values = values * (1 + 0.01 * random.standard_normal(values.shape))
    axes = {"time": ("time", TIME, {"units": "s"}), "wavelength": ("wavelength", nm, {"units": "nm"})}
    return grown, rate, xarray.Dataset({"R": (("time", "wavelength"), values)}, axes)


COLUMNS = (
    "alone: wrong %",
    "rms nm",
    "together: wrong %",
    "open %",
    "false breaks",
    "rms nm",
    "in 95 %",
    "least",
    "rate rms nm/min",
    "in 95 %",
    "least",
    "s",
)


def scored(scene, nm, flaws, random, lamp_curve):
    """The numbers of `COLUMNS` of one film, without the least ones."""
    grown, rate, data = draw(random, nm, flaws)
    began = perf_counter()
    found = pl.series(data, scene, lamp_curve=lamp_curve)
    seconds = perf_counter() - began
    alone = np.asarray(found.map["thickness"]) - grown
    off, turn = np.asarray(found["thickness"]) - grown, np.asarray(found["rate"]) - rate
    right = np.abs(alone) < HALF_ORDER
    return [
        100 * np.mean(~right),
        np.sqrt(np.mean(alone[right] ** 2)),
        100 * np.mean(np.abs(off) > HALF_ORDER),
        100 * found.status.get("ambiguous", 0) / len(TIME),
        len(found.breaks),
        np.sqrt(np.mean(off**2)),
        100 * np.mean(np.abs(off) < 1.96 * found["thickness_stderr"]),
        np.sqrt(np.mean(turn**2)),
        100 * np.mean(np.abs(turn) < 1.96 * found["rate_stderr"]),
        seconds,
    ]


LASERS = np.array([633.0, 532.0, 850.0])
TRACES = {
    "one laser": 1,
    "two lasers": 2,
    "three lasers": 3,
    "turns evenly": 1,
    "turns abruptly near an extremum": 1,
    "absorbs": 1,
    "one laser, start not told": 1,
}
OF_TRACES = (
    "wrong %",
    "of these decided",
    "open %",
    "decided: rms nm",
    "rms z",
    "in 95 %",
    "least",
    "rate in 95 %",
    "CPU s",
)


def course(random, name, fringe, at):
    """Thickness against the time `at` from 0 to 1."""
    if name == "turns evenly":
        return fringe * (1 + random.uniform(2, 6) * np.abs(np.sin(np.pi * at * random.uniform(0.8, 1))))
    if name == "turns abruptly near an extremum":
        top, turn = random.integers(3, 9) * fringe / 2 + random.uniform(-8, 8), random.uniform(0.4, 0.6)
        last = random.uniform(0.1, 0.9) * top
        return np.where(at < turn, top * at / turn, top + (last - top) * (at - turn) / (1 - turn))
    top, pace = random.uniform(2, 8) * fringe, random.uniform(0.4, 2)
    first = random.uniform(0.3, 2) * fringe if TRACES[name] > 1 else 0.0
    return first + top * (1 - np.exp(-at / pace)) / (1 - np.exp(-1 / pace))


def traced(name, random):
    """The numbers of `OF_TRACES` of one film, without the least one."""
    nm, index, substrate = LASERS[: TRACES[name]], 1.46, SUBSTRATE
    if name == "absorbs":
        index = random.uniform(1.8, 3.0) + 1j * random.uniform(0.02, 0.5)
    fringe = LASERS[0] / 2 / np.real(index)
    at = np.linspace(0, 1, random.choice([300, 600, 1000]))
    grown = course(random, name, fringe, at)
    values = np.stack([reflectance(grown, np.conj(index), x)[:, 0] for x in nm], axis=1)
    values = random.uniform(0.5, 5) * values + random.uniform(-0.2, 0.5)
    size = random.uniform(0.005, 0.03) * np.ptp(values, axis=0)
    values += size * random.standard_normal(values.shape)
    axes = {"time": ("time", 600 * at, {"units": "s"}), "wavelength": ("wavelength", nm, {"units": "nm"})}
    first = float(grown[0]) if nm.size == 1 and "not told" not in name else None
    film = pl.Layer(index, pl.Free(0, 1.25 * grown.max() + 200, first=first))
    scene = pl.Scene(film, substrate, instrument=pl.Instrument(scale="free", offset="free"))
    began = process_time()
    found = pl.series(xarray.Dataset({"R": (("time", "wavelength"), values)}, axes), scene)
    seconds, status = process_time() - began, found.dataset.status.values
    off, rate = np.asarray(found["thickness"]) - grown, np.gradient(grown, 10 * at)
    codes = [STATUSES.index(word) for word in ("converged", "by-neighbours")]
    decided, wrong = np.isin(status, codes), np.abs(off) > fringe / 8
    right = decided & ~wrong
    close = np.abs(off) < 1.96 * found["thickness_stderr_noise"].values
    turned = np.abs(np.asarray(found["rate"]) - rate) < 1.96 * found["rate_stderr_noise"].values
    told = any("abruptly at an extremum" in text for text in found.warnings)
    row = [
        100 * np.mean(wrong),
        100 * np.mean(wrong & decided),
        100 * np.mean(~decided),
        np.sqrt(np.mean(off[right] ** 2)),
        np.sqrt(np.mean((off / found["thickness_stderr_noise"].values)[right] ** 2)),
        100 * np.mean(close[right]),
        100 * np.mean(turned[right]),
        seconds,
    ]
    numbers = " ".join(f"{x:.3g}" for x in row)
    print(f"# {name}: {found.status}, turn told: {told}, {numbers}", file=sys.stderr, flush=True)
    return row


def traces(draws, seed, only):
    print("| trace | " + " | ".join(OF_TRACES) + " |\n|---|" + "---|" * len(OF_TRACES))
    names = {name: number for number, name in enumerate(TRACES) if only in (None, name)}
    every = [
        [traced(name, np.random.default_rng([seed, number, i])) for name, number in names.items()]
        for i in range(draws)
    ]
    for name, rows in zip(names, np.swapaxes(every, 0, 1), strict=True):
        mean = np.nanmean(rows, axis=0)
        every = [*mean[:6], np.nanmin(rows, axis=0)[5], *mean[6:]]
        print(f"| {name} | " + " | ".join(f"{x:.2g}" if x < 90 else f"{x:.0f}" for x in every) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=10)
    parser.add_argument("--only", choices=FLAWS)
    parser.add_argument("--narrow", action="store_true", help="600 to 700 nm, else 450 to 900 nm")
    parser.add_argument("--scale", choices=["free", "slow", "slowly"], help="of the scene; slowly: in time")
    parser.add_argument("--lamp-curve", choices=["joint"], help="one gain against wavelength for all times")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--traces", action="store_true", help="of lasers, in place of spectra")
    parser.add_argument("--trace", choices=TRACES, help="only this one")
    given = parser.parse_args()
    if given.traces:
        return traces(given.draws, given.seed, given.trace)
    nm = np.linspace(600, 700, 60) if given.narrow else np.linspace(450, 900, 120)
    in_time = given.scale == "slowly"
    instrument = pl.Instrument(scale={"varies": "slowly"} if in_time else given.scale or 1.0)
    scene = pl.Scene(pl.Layer(1.46, pl.Free(0, 4000)), SUBSTRATE, instrument=instrument)
    print("| not told | " + " | ".join(COLUMNS) + " |\n|---|" + "---|" * len(COLUMNS))
    for name in [given.only] if given.only else FLAWS:
        rows = [
            scored(
                scene,
                nm,
                FLAWS[name],
                np.random.default_rng([given.seed, number, len(name)]),
                given.lamp_curve,
            )
            for number in range(given.draws)
        ]
        mean, least = np.mean(rows, axis=0), np.min(rows, axis=0)
        every = [*mean[:7], least[6], *mean[7:9], least[8], mean[9]]
        print(
            f"| {name} | " + " | ".join(f"{x:.2g}" if x < 90 else f"{x:.0f}" for x in every) + " |",
            flush=True,
        )


if __name__ == "__main__":
    main()
