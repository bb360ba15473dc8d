"""The device of a benchmark, time on it, and the bandwidth of its memory.

Programs run asynchronously on a GPU, and many of them for less time than a call takes: `seconds` starts
several calls, waits for the last one and measures the wall time.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

COPIED_BYTES = {"cpu": 2**28, "gpu": 2**31}
"""Size of the array that is copied: far above the caches."""
LEAST_SECONDS = 0.05


def chosen(kind: str) -> Any:
    """The first JAX device of a kind, made JAX's default. Without one, prints why and exits with code 2."""
    try:
        device = jax.devices(kind)[0]
    except RuntimeError:
        here = ", ".join(sorted({device.platform for device in jax.devices()}))
        print(
            f"--device {kind}: JAX finds no {kind.upper()} on this machine, only {here}. Use a machine with"
            " one and install JAX for it (pip install 'jax[cuda12]' for NVIDIA), or leave the flag out.",
            file=sys.stderr,
        )
        raise SystemExit(2) from None
    jax.config.update("jax_default_device", device)
    return device


def seconds(run: Callable[[], Any], rounds: int = 9) -> float:
    """Median wall time of a call, among several that are started together, after one that compiles."""
    jax.block_until_ready(run())
    began = time.perf_counter()
    jax.block_until_ready(run())
    calls = max(1, min(1000, round(LEAST_SECONDS / (time.perf_counter() - began))))
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        for _ in range(calls):
            answer = run()  # freed when the next one is started: the memory holds few of them
        jax.block_until_ready(answer)
        times.append((time.perf_counter() - began) / calls)
    return statistics.median(times)


def bandwidth(device: Any) -> float:
    """Bytes per second that a copy reads and writes in the memory of a device."""
    size = COPIED_BYTES["cpu" if device.platform == "cpu" else "gpu"]
    with jax.default_device(device):
        array = [jnp.zeros(size // 4, jnp.float32)]
        add = jax.jit(lambda x: x + 1, donate_argnums=0)  # in place: new pages take longer

        def copy() -> Any:
            array[0] = add(array[0])
            return array[0]

        return 2 * size / seconds(copy)
