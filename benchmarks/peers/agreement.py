"""Jones matrices of random stacks by pellicle and by pyElli's 4×4 solver, against 50 digits.

Run `python benchmarks/peers/agreement.py --stacks 1000`. Every stack is computed with permittivity tensors;
one without biaxial media also in the closed form of uniaxial media, and one of isotropic media also by the
2×2 method. Fewer layers than four are filled up with layers of no thickness, so that each method compiles
once. pyElli runs in the environment of `python benchmarks/peers`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import jax
import jax.numpy as jnp
import numpy as np
from environment import install, peers_python
from packages import PEERS
from stacks import FAMILIES, MOST, Stack, jones_matrix, random_stacks

from pellicle.optics import coherent
from pellicle.optics.anisotropy import Principal, permittivity, uniaxial
from pellicle.optics.berreman.stack import polarised
from pellicle.optics.pair import to_complex, to_pair

jax.config.update("jax_enable_x64", True)

SAME = 1e-9
"""Largest error of a right answer."""


def ours(stacks: Sequence[Stack], as_medium: Callable[[Any, Any], Any]) -> np.ndarray:
    """Return our Jones matrices (stacks, 2, 2); `as_medium(indices, turns)` makes a medium of optics."""

    @jax.jit
    def matrices(indices: Any, turns: Any, phases: Any, ambient: Any, angle: Any) -> Any:
        media = [as_medium([to_pair(x) for x in n], t) for n, t in zip(indices, turns, strict=True)]
        *layers, substrate = media
        if all(isinstance(n, list) for n in media):  # isotropic media, by the 2×2 method
            numbers = [n[0] for n in layers]
            s, p = coherent.responses(ambient, numbers, substrate[0], list(phases), angle)
            r_s, r_p = (to_complex(x.reflected) / to_complex(x.denominator) for x in (s, p))
            return jnp.stack([r_p, 0 * r_p, 0 * r_p, r_s], axis=-1)
        found = polarised(ambient, layers, substrate, list(phases), angle)
        return jnp.stack([to_complex(x) for x in found.reflected], axis=-1)

    def filled(media: list[Any], depths: list[float]) -> list[Any]:
        return [media[0]] * (MOST - len(depths)) + media

    indices = [filled(x.indices, x.depths) for x in stacks]
    turns = [filled(x.turns, x.depths) for x in stacks]
    depths = [[0.0] * (MOST - len(x.depths)) + x.depths for x in stacks]
    phases = 2 * np.pi * np.transpose(depths) / [x.wavelength for x in stacks]
    ambient, angle = ([getattr(x, name) for x in stacks] for name in ("ambient", "angle"))
    columns = np.moveaxis(indices, 0, -1), np.deg2rad(np.moveaxis(turns, 0, -1)), phases
    found = matrices(*columns, np.array(ambient), np.deg2rad(angle))
    return np.asarray(found).reshape(-1, 2, 2)


def by_pyelli(stacks: Sequence[Stack], python: Path) -> np.ndarray:
    """Return pyElli's Jones matrices (stacks, 2, 2)."""
    given = [
        x._asdict() | {"indices": [[(n.real, n.imag) for n in medium] for medium in x.indices]}
        for x in stacks
    ]
    worker = Path(__file__).with_name("pyelli_stacks.py")
    done = subprocess.run([str(python), str(worker)], input=json.dumps(given), capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"pyElli did not run: {done.stderr.strip()}")
    return np.array(json.loads(done.stdout)).view(complex).reshape(-1, 2, 2)


def main() -> None:
    """Print the largest errors of each family of stacks, and the numbers of wrong answers."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--stacks", type=int, default=1000, metavar="COUNT")
    parser.add_argument("--python", type=Path, help="Python with pyElli; by default it is installed")
    given = parser.parse_args()
    python = given.python
    if python is None:
        python = peers_python()
        problem = install(python, next(x for x in PEERS if x.adapter == "pyelli4x4"))
        if problem:
            raise SystemExit(f"pyElli is not installed: {problem}")
    stacks = random_stacks(given.stacks)
    truth = np.array([jones_matrix(x) for x in stacks])
    methods = {
        "pellicle, tensors": (lambda n, t: permittivity(Principal(*n), *t), lambda x: True),
        "pellicle, closed form": (lambda n, t: uniaxial(n[0], n[2], t[0], t[1]), lambda x: x.is_uniaxial),
        "pellicle, 2×2": (lambda n, t: n, lambda x: x.is_isotropic),
    }
    answers = {"pyElli 4×4": by_pyelli(stacks, python)}
    for name, (as_medium, serves) in methods.items():
        chosen = [i for i, x in enumerate(stacks) if serves(x)]
        answers[name] = np.full_like(truth, np.nan)
        answers[name][chosen] = ours([stacks[i] for i in chosen], as_medium)
    served = {name: np.array([serves(x) for x in stacks]) for name, (_, serves) in methods.items()}
    print("| stacks | method | number | largest error | median | wrong |\n|---|---|---|---|---|---|")
    for family in FAMILIES:
        here = np.array([x.family == family for x in stacks])
        for name in (*methods, "pyElli 4×4"):
            among = here & served.get(name, here)
            if among.any():
                error = np.max(np.abs(answers[name] - truth), axis=(1, 2))[among]
                wrong = np.sum(~(error < SAME))
                print(
                    f"| {family} | {name} | {error.size} | {np.max(error):.0e} | {np.median(error):.0e} "
                    f"| {wrong} |"
                )
    right = np.max(np.abs(answers["pyElli 4×4"] - truth), axis=(1, 2)) < SAME
    apart = np.max(np.abs(answers["pyElli 4×4"] - answers["pellicle, tensors"]), axis=(1, 2))[right]
    print(f"\nWhere pyElli is right ({apart.size} stacks), both differ by at most {np.max(apart):.0e}.")


if __name__ == "__main__":
    main()
