"""Time per point of a birefringent film of any orientation, beside pyElli and difftmm.

Run `python benchmarks/anisotropic.py`. A point is one wavelength, with the Jones matrix of reflection of a
uniaxial film of 237 nm on glass at 55°. Times are processor times on one thread, of POINTS wavelengths in one
call. The methods take turns of at least TURN seconds, in which they repeat the call; the table has medians.
pyElli runs its 4×4 solver with its exact propagators (exponentials of matrices by SciPy, or by PyTorch where
that is installed, and eigenvectors); difftmm is complex64, and its `FilmSolver` lays principal axes along
those of the laboratory. Both take part if they are installed (`pip install pyElli packaging difftmm`), and
`benchmarks/peers/agreement.py` compares the values.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import jax
import jax.numpy as jnp
import numpy as np

from pellicle.optics.anisotropy import Medium, Principal, permittivity, uniaxial
from pellicle.optics.berreman.stack import polarised
from pellicle.optics.pair import to_complex

jax.config.update("jax_enable_x64", True)

ORDINARY, EXTRAORDINARY, GLASS, DEPTH, ANGLE = 1.66, 1.49, 1.52, 237.0, 55.0
THETA, PHI = 40.0, 25.0
POINTS, ROUNDS = 20_000, 7
TURN = 0.1
"""s of processor time: one call of 1 ms after another program's would mostly measure the caches."""


def ours(medium: Medium, count: int, dtype: Any = np.float64) -> tuple[Callable[[], Any], float]:
    """Return our computation at `count` wavelengths, and its compilation time in s."""

    def matrix(wavelength: Any) -> Any:
        angle = jnp.asarray(np.deg2rad(ANGLE), wavelength.dtype)
        media = jax.tree.map(lambda x: jnp.asarray(x, wavelength.dtype), (medium, GLASS))
        layer, substrate = media
        found = polarised(1.0, [layer], substrate, [2 * jnp.pi * DEPTH / wavelength], angle, dichroic=False)
        return [to_complex(x) for x in found.reflected]

    wavelength = jnp.linspace(400.0, 800.0, count, dtype=dtype)
    start = time.process_time()
    compiled = jax.jit(matrix).lower(wavelength).compile()
    seconds = time.process_time() - start
    return lambda: jax.block_until_ready(compiled(wavelength)), seconds


def by_pyelli(
    layers: list[tuple[Any, float]], substrate: complex, ambient: float, count: int, *propagator: str
):
    """Return pyElli's computation; a layer is ((n_x, n_y, n_z), (θ, φ, ψ) in degrees) and a thickness."""
    import elli
    from elli import solver4x4

    def constant(n: complex) -> Any:
        return elli.ConstantRefractiveIndex(n=n)

    def crystal(indices: tuple[complex, ...], turns: tuple[float, ...]) -> Any:
        medium = elli.BiaxialMaterial(*map(constant, indices))
        theta, phi, psi = turns
        z, y = [0, 0, 1], [0, 1, 0]
        about = elli.rotation_v_theta
        medium.set_rotation(about(z, phi) @ about(y, theta) @ about(z, psi))
        return medium

    structure = elli.Structure(
        elli.IsotropicMaterial(constant(ambient)),
        [elli.Layer(crystal(*medium), depth) for medium, depth in layers],
        elli.IsotropicMaterial(constant(substrate)),
    )
    nm = np.linspace(400.0, 800.0, count)
    solver = {"propagator": getattr(solver4x4, propagator[0])(*propagator[1:]), "solver": solver4x4.Solver4x4}
    return lambda angle=ANGLE: structure.evaluate(nm, angle, **solver).jones_matrix_r


def by_difftmm(count: int) -> Callable[[], Any]:
    """Return difftmm's computation of a film with principal axes along the surface."""
    import torch
    from difftmm.film_solver_anisotropic import FilmSolver

    torch.set_num_threads(1)
    medium = (EXTRAORDINARY, ORDINARY, ORDINARY)
    film = FilmSolver(1.0, GLASS, [medium], [1e-3 * DEPTH], thickness_max=1.0, device=torch.device("cpu"))
    micrometres = torch.linspace(0.4, 0.8, count)
    angle = torch.tensor([np.deg2rad(ANGLE)], dtype=torch.float32)
    return lambda: film.simulate(angle, micrometres)


def turn(run: Callable[[], Any]) -> float:
    """Return the processor time of one computation in s, the mean of a turn."""
    count, start = 0, time.process_time()
    while (passed := time.process_time() - start) < TURN:
        run()
        count += 1
    return passed / count


def speed() -> None:
    """Print times per point."""
    turns = np.deg2rad(THETA), np.deg2rad(PHI)
    film = uniaxial(ORDINARY, EXTRAORDINARY, *turns)
    tensor = permittivity(Principal(ORDINARY, 1.55, EXTRAORDINARY), *turns, 0.3)
    methods: dict[str, Callable[[], Any]] = {}
    for name, medium, dtype in (
        ("pellicle, uniaxial", film, np.float64),
        ("pellicle, uniaxial, float32", film, np.float32),
        ("pellicle, biaxial", tensor, np.float64),
    ):
        run, seconds = ours(medium, POINTS, dtype)
        methods[name] = run
        print(f"{name}: compiled in {seconds:.1f} s")
    if find_spec("elli"):
        crystal = (ORDINARY, ORDINARY, EXTRAORDINARY), (THETA, PHI, 0.0)
        torch = [("PropagatorExpm", "torch")] if find_spec("torch") else []
        for propagator in (("PropagatorExpm", "scipy"), *torch, ("PropagatorEig",)):
            run = by_pyelli([(crystal, DEPTH)], GLASS, 1.0, POINTS, *propagator)
            methods[f"pyElli, {' by '.join(propagator)}"] = run
    if find_spec("difftmm"):
        methods["difftmm, axes along the surface, complex64"] = by_difftmm(POINTS)
    times: dict[str, list[float]] = {name: [] for name in methods}
    for run in methods.values():
        run()
    for _ in range(ROUNDS):
        for name, run in methods.items():
            times[name].append(turn(run) / POINTS * 1e6)
    first = statistics.median(times["pellicle, uniaxial"])
    print("| method | µs per point | relative |\n|---|---|---|")
    for name, each in times.items():
        print(f"| {name} | {statistics.median(each):.3g} | {statistics.median(each) / first:.3g} |")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    speed()
