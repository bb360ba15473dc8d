"""Time per RGB sample of each BRDF model, forward and with its Jacobian, on one thread.

Run `python benchmarks/brdf.py`. A sample is one pair of directions with three channels; the
Jacobian is with respect to every parameter of the model. Models take turns in each round, so that noise of
the machine affects all of them; the table gives medians, and the minimum in brackets.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import time

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from pellicle.brdf import direction, model
from pellicle.brdf.models import Model

jax.config.update("jax_enable_x64", True)

MEASURED = {
    "granier-heidrich": model("granier-heidrich"),
    "granier-heidrich-reciprocal": model("granier-heidrich-reciprocal"),
    "microfacet-film": model("microfacet-film"),
    "microfacet-film up to 500 nm": model("microfacet-film").for_thickness_up_to(500.0),
    "microfacet-film up to 100 nm": model("microfacet-film").for_thickness_up_to(100.0),
}


def programs(brdf: Model, dtype: type, samples: int) -> dict[str, tuple]:
    """Return the compiled forward function and Jacobian with their arguments."""
    rng = np.random.default_rng(0)
    theta, phi = rng.uniform(0, 85, (2, samples)), rng.uniform(0, 360, (2, samples))
    i, o = (direction(t, p).astype(dtype) for t, p in zip(theta, phi, strict=True))
    values = {key: jnp.asarray(value, dtype) for key, value in brdf.defaults().items()}
    x, unravel = ravel_pytree(values)
    forward = jax.jit(lambda x, i, o: brdf(unravel(x), i, o))
    return {"forward": (forward, (x, i, o)), "Jacobian": (jax.jit(jax.jacfwd(forward)), (x, i, o))}


def main(rounds: int, samples: int) -> None:
    runs = {
        (name, dtype.__name__, kind): run
        for name, brdf in MEASURED.items()
        for dtype in (np.float32, np.float64)
        for kind, run in programs(brdf, dtype, samples).items()
    }
    for function, arguments in runs.values():
        function(*arguments).block_until_ready()
    times: dict[tuple, list[float]] = {key: [] for key in runs}
    for _ in range(rounds):
        for key, (function, arguments) in runs.items():
            began = time.perf_counter()
            function(*arguments).block_until_ready()
            times[key].append((time.perf_counter() - began) / samples * 1e9)
    print(
        f"jax {jax.__version__}, Python {platform.python_version()}, {platform.machine()}, {samples} samples"
    )
    print(f"{'ns per RGB sample':<30}{'':<10}{'forward':>16}{'Jacobian':>18}")
    for name in MEASURED:
        for dtype in ("float32", "float64"):
            cells = [times[name, dtype, kind] for kind in ("forward", "Jacobian")]
            text = [f"{statistics.median(cell):.0f} ({min(cell):.0f})" for cell in cells]
            print(f"{name:<30}{dtype:<10}{text[0]:>16}{text[1]:>18}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--samples", type=int, default=1 << 15)
    given = parser.parse_args()
    main(given.rounds, given.samples)
