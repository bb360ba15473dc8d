"""Points per second of films, stacks, searches and maps on a GPU, in float32 and float64.

Run `python benchmarks/gpu.py` on a machine with a GPU and JAX for it (`pip install 'jax[cuda13]'`); with
`--device cpu` the same tables, of fewer points. A point is a wavelength of a film or stack. All times are
wall times of queued calls, without compilation. Each table has the largest error against NumPy or float64.

1. R and T of a film at 45°, without polarisation, beside the limit by the bandwidth of the memory: that of
   writing R and T. A copy measures it.
2. R of s light at 45° of stacks, and its gradient in all thicknesses, in layer-points per second (points
   times layers), beside tmm_fast (complex128) and tmmax (float32) where these are installed.
3. The search of a fit: deviances of candidates, and their share of the speed of the film function alone.
4. Pixels per second of a map: minima, errors and status of each.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import device as on_device
import fit
import jax
import jax.numpy as jnp
import map as maps
import numpy as np
from film import DISPERSING, WAVELENGTH, numpy_airy
from film_packages import ABSORBING, ANGLE, SUBSTRATE

import pellicle as pl
from pellicle.data.cube import Cube
from pellicle.fitting.evaluation import deviances
from pellicle.fitting.film.problem import make
from pellicle.mapping.pixels import fit_pixels, prepare

jax.config.update("jax_enable_x64", True)

FILMS = {"transparent": 1.46, "absorbing": ABSORBING, "dispersing": DISPERSING}
PAIR = (2.3 + 0.002j, 1.46)
"""Indices of the layers of a stack, in turns."""
LAYERS = 1, 4, 21, 40, 200
DTYPES = np.float32, np.float64


def films(device: Any, thicknesses: int) -> Iterator[tuple[str, ...]]:
    """Lines of the first table."""
    bandwidth = on_device.bandwidth(device)
    print(f"a copy moves {bandwidth / 1e9:.0f} GB/s\n")
    for dtype in DTYPES:
        limit = bandwidth / (2 * np.dtype(dtype).itemsize)
        for kind, layer in FILMS.items():
            rate, error = _film(device, dtype, layer, thicknesses)
            name = f"{np.dtype(dtype).name}, {kind}"
            yield name, f"{rate:.3g}", f"{limit:.3g}", f"{rate / limit:.0%}", f"{error:.1e}"


def _film(device: Any, dtype: type, layer: complex | np.ndarray, thicknesses: int) -> tuple[float, float]:
    """Points per second and the error of one film, on a part of the thicknesses."""
    kind = np.result_type(dtype, np.complex64) if np.iscomplexobj(layer) else dtype
    axes = WAVELENGTH[None, :], np.linspace(0.0, 1000.0, thicknesses)[:, None]
    wavelength, thickness = (jax.device_put(axis.astype(dtype), device) for axis in axes)
    index = jax.device_put(np.asarray(layer, kind), device)

    @jax.jit
    def both(wavelength: Any, thickness: Any, index: Any) -> Any:
        media = index, dtype(SUBSTRATE)
        return tuple(
            f(wavelength, thickness, *media, angle=dtype(ANGLE)) for f in (pl.reflectance, pl.transmittance)
        )

    rate = thicknesses * WAVELENGTH.size / on_device.seconds(lambda: both(wavelength, thickness, index))
    some = np.asarray(thickness[:: max(1, thicknesses // 1000)])
    truth = numpy_airy(layer, np.asarray(wavelength, float), np.asarray(some, float))
    found = both(wavelength, jax.device_put(some, device), index)
    assert all(x.dtype == dtype for x in found), [x.dtype for x in found]
    return rate, max(float(np.max(np.abs(np.asarray(a) - b))) for a, b in zip(found, truth, strict=True))


def stacks(device: Any, size: int) -> Iterator[tuple[str, ...]]:
    """Lines of the second table, with about `size` layer-points in a call."""
    for layers in LAYERS:
        count = max(size // (layers * WAVELENGTH.size), 2)
        depths = np.random.default_rng(layers).uniform(40.0, 120.0, (layers, count))
        truth = _by_numpy(depths[:, :2])
        for name, some, run, slope in _programs(device, depths):
            on = layers * depths[:, :some].shape[1] * WAVELENGTH.size
            try:
                error = np.max(np.abs(np.asarray(run())[:2] - truth))
                rates = [on / on_device.seconds(each, 5) for each in (run, slope) if each]
            except Exception as problem:  # of another package, or of the memory: the next line is measured
                print(f"{name}, {layers} layers: {problem!r:.300}", file=sys.stderr)
                continue
            cells = [f"{rate:.3g}" for rate in rates]
            yield f"{layers}", name, *cells, *([""] * (2 - len(cells))), f"{error:.1e}"


def _programs(device: Any, depths: np.ndarray) -> Iterator[tuple[str, int | None, Any, Any]]:
    """Name, number of stacks, program and gradient of each package."""
    for dtype in DTYPES:
        yield f"pellicle {np.dtype(dtype).name}", None, *_by_pellicle(device, depths, dtype)
    for name, make_one in (("tmm_fast", _by_tmm_fast), ("tmmax float32", _by_tmmax)):
        some = max(depths.shape[1] // 16, 2)  # they take more memory for each point
        try:
            yield name, some, make_one(device, depths[:, :some]), None
        except ImportError as error:
            print(f"{error.name} is not installed: left out", file=sys.stderr)


def _by_pellicle(device: Any, depths: np.ndarray, dtype: type) -> tuple[Callable[[], Any], Callable[[], Any]]:
    kinds = [np.asarray(n, np.result_type(dtype, np.complex64)) for n in PAIR]
    layers = [kinds[i % 2] for i in range(len(depths))]
    wavelength, given = (jax.device_put(x.astype(dtype), device) for x in (WAVELENGTH, depths))

    def reflectance(depths: Any) -> Any:
        below, angle = dtype(SUBSTRATE), dtype(ANGLE)
        film = (depths[0], layers[0]) if len(layers) == 1 else (list(depths), layers)
        return pl.reflectance(wavelength, *film, below, angle=angle, polarisation="s")

    value = jax.jit(lambda d: reflectance(d[:, :, None]))
    slope = jax.jit(jax.value_and_grad(lambda d: jnp.sum(reflectance(d[:, :, None]))))
    return (lambda: value(given)), (lambda: slope(given))


def _by_tmm_fast(device: Any, depths: np.ndarray) -> Callable[[], Any]:
    import torch
    from tmm_fast import coh_tmm

    where = "cpu" if device.platform == "cpu" else "cuda"
    indices = [1.0, *(PAIR[i % 2] for i in range(len(depths))), SUBSTRATE]
    index = torch.tensor(indices, dtype=torch.complex128, device=where)
    index = index[None, :, None].expand(depths.shape[1], len(indices), WAVELENGTH.size).clone()
    infinite = np.full((depths.shape[1], 1), np.inf)
    depth = torch.tensor(np.hstack([infinite, depths.T, infinite]), device=where)
    angle = torch.tensor([np.deg2rad(ANGLE)], device=where)
    light = torch.tensor(WAVELENGTH, device=where)

    def run() -> np.ndarray:
        found = coh_tmm("s", index, depth, angle, light, device=where)["R"][:, 0]
        return np.asarray(found[:2].cpu()) if where == "cpu" else _waited(torch, found)

    return run


def _waited(torch: Any, found: Any) -> np.ndarray:
    """The first rows of what a GPU has computed, when all is computed."""
    torch.cuda.synchronize()
    return found[:2].cpu().numpy()


def _by_tmmax(device: Any, depths: np.ndarray) -> Callable[[], Any]:
    from tmmax.tmm import vectorized_coh_tmm

    media = [(1.0, 0.0), *((complex(n).real, complex(n).imag) for n in PAIR), (SUBSTRATE, 0.0)]
    axis = np.array([300e-9, 900e-9])
    table = np.stack([np.stack([axis, n + 0 * axis, k + 0 * axis]) for n, k in media]).astype(np.float32)
    order = np.array([0, *(1 + i % 2 for i in range(len(depths))), 3], np.int32)
    given = jax.device_put((depths.T * 1e-9).astype(np.float32), device)
    light = jax.device_put((WAVELENGTH * 1e-9).astype(np.float32), device)
    with jax.enable_x64(False):
        one = jax.vmap(
            lambda d: vectorized_coh_tmm(
                jnp.asarray(table),
                jnp.asarray(order),
                d,
                light,
                jnp.deg2rad(jnp.array([ANGLE])),
                jnp.array([False]),
            )[0].reshape(-1)
        )
        program = jax.jit(one)

    def run() -> Any:
        with jax.enable_x64(False):
            return program(given)

    return run


def _by_numpy(depths: np.ndarray) -> np.ndarray:
    """R of s light by 2 × 2 matrices in complex128, of shape (stacks, wavelengths)."""
    a, cosine = np.sin(np.deg2rad(ANGLE)), np.cos(np.deg2rad(ANGLE))
    q_sub, wave = np.sqrt(SUBSTRATE**2 - a**2), 2 * np.pi / WAVELENGTH
    E, H = (
        np.ones((depths.shape[1], WAVELENGTH.size), complex),
        np.full((depths.shape[1], WAVELENGTH.size), q_sub + 0j),
    )
    for i in reversed(range(len(depths))):
        q = np.sqrt(complex(PAIR[i % 2]) ** 2 - a**2)
        phase = q * wave * depths[i][:, None]
        E, H = E * np.cos(phase) - 1j * H * np.sin(phase) / q, H * np.cos(phase) - 1j * q * E * np.sin(phase)
        size = np.abs(E) + np.abs(H)
        E, H = E / size, H / size
    return np.abs((cosine * E - H) / (cosine * E + H)) ** 2


def searches(device: Any, size: int) -> Iterator[tuple[str, ...]]:
    """Lines of the third table: deviances of about `size` points in a call."""
    for case in fit.CASES:
        problem = make(fit.measured(fit.spectrum(case), case.scene))
        [view] = problem.views
        count = size // view.rows
        units = np.random.default_rng(1).uniform(0.1, 0.9, (count, len(problem.parameters)))
        values = problem.seen_by(view, np.asarray(problem.values(units)))
        layers = sum(p.key == "thickness" for p in problem.parameters)
        film = fit.film(case, jax.device_put(values[:, -layers:], device))
        bare = count * view.rows / on_device.seconds(film)
        _, truth = _deviances(view, np.float64, jax.devices("cpu")[0], values[: fit.CANDIDATES])
        for dtype in DTYPES:
            with jax.enable_x64(dtype is np.float64):
                run, answer = _deviances(view, dtype, device, values)
                rate = count * view.rows / on_device.seconds(run)
            error = np.max(np.abs(answer[: fit.CANDIDATES] / truth - 1))
            share = f"{rate / bare:.0%}" if dtype is np.float64 else ""
            yield f"{case.name}, {np.dtype(dtype).name}", f"{rate:.3g}", share, f"{error:.1e}"


def _deviances(
    view: Any, dtype: type, device: Any, values: np.ndarray
) -> tuple[Callable[[], Any], np.ndarray]:
    arrays, values = jax.tree_util.tree_map(
        lambda x: jax.device_put(np.asarray(x, dtype), device), (view.arrays, values)
    )
    with jax.default_device(device):
        run = lambda: deviances(view.form, arrays, values).value  # noqa: E731
        return run, np.asarray(run())


def pixels(count: int) -> Iterator[tuple[str, ...]]:
    """Lines of the fourth table."""
    for kind in maps.kinds(count):
        arrays = {"values": kind.values[None], "sigma": np.full(maps.NM.size, maps.SIGMA)}
        cube = Cube(arrays, maps.NM, calibrated=kind.calibrated)
        model, where = prepare(cube, kind.scene), (slice(None), slice(None))
        found = fit_pixels(model, cube, where)
        at = [p.key for p in model.parameters].index("thickness")
        right = np.abs(found.values[:, at] - kind.truth) < 4 * found.stderr_noise[:, at]
        again = partial(_values, model, cube, where)
        rate = count / on_device.seconds(again, 3)
        yield kind.name, f"{rate:.3g}", f"{np.mean(right):.1%}"


def _values(*arguments: Any) -> np.ndarray:
    return fit_pixels(*arguments).values


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--device", choices=("gpu", "cpu"), default="gpu", help="where JAX computes (gpu)")
    parser.add_argument("--only", nargs="*", choices=("films", "stacks", "searches", "pixels"), default=[])
    asked = parser.parse_args()
    device = on_device.chosen(asked.device)
    small = device.platform == "cpu"
    print(f"{device.device_kind}, jax {jax.__version__}")
    tables = {
        "films": (
            ("film", "points per s", "limit", "share", "error"),
            lambda: films(device, 1000 if small else 100_000),
        ),
        "stacks": (
            ("layers", "program", "layer-points per s", "with gradient", "error"),
            lambda: stacks(device, 2**18 if small else 2**27),
        ),
        "searches": (
            ("search", "points per s", "of the film function", "error of the deviance"),
            lambda: searches(device, 2**17 if small else 2**23),
        ),
        "pixels": (("map, free", "pixels per s", "right"), lambda: pixels(2**10 if small else 2**15)),
    }
    for name, (header, lines) in tables.items():
        if not asked.only or name in asked.only:
            fit.table(header, lines())


if __name__ == "__main__":
    main()
