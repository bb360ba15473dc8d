"""Operations that the compiled evaluations of a fit execute per data point.

XLA's CPU backend computes a cheap expression again in each loop that uses it; and a loop that joins arrays or
sums, into which it has moved a simulation, runs without vector instructions. Its own cost analysis shows
neither: it counts fewer operations for the slow programs. So the instructions of the optimised program are
counted here, each as often as the loop that contains it has elements, and `SCALAR` times that in loops that
join or sum.
"""

import re
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
from pellicle.fitting.film.problem import make, measured

CANDIDATES, POINTS = 16, 64
FREE = {"parameter", "constant", "broadcast", "bitcast", "copy", "reshape", "slice", "transpose", "tuple"}
JOINS = {"concatenate", "pad", "reduce", "dynamic-slice", "dynamic-update-slice", "gather"}
SCALAR = 4  # float64 numbers in a vector register of AVX2
FREE |= {"get-tuple-element", "concatenate", "iota", "pad", "convert", "real", "imag", "complex"}
INSTRUCTION = re.compile(r"^(?:ROOT )?%?[\w.\-]+ = (\(.*?\)|\S+) ([\w\-]+)\((.*)$")


def operations(compiled: Any) -> float:
    """Arithmetic operations that a compiled program executes, loops of unknown length once."""
    bodies: dict[str, list[tuple[str, ...]]] = {}
    body, entry = [], ""
    for line in compiled.as_text().splitlines():
        if head := re.match(r"^(ENTRY )?%?([\w.\-]+) \(.*\{$", line):
            body = bodies.setdefault(head[2], [])
            entry = head[2] if head[1] else entry
        elif found := INSTRUCTION.match(line.strip()):
            body.append(found.groups())

    def elements(shape: str) -> int:
        sizes = re.findall(r"\w\d+\[([\d,]*)\]", shape)
        return max((int(np.prod([int(n) for n in s.split(",") if n])) for s in sizes), default=0)

    def count(name: str) -> float:
        total = 0.0
        for shape, kind, rest in bodies[name]:
            inner = re.search(r"(?:calls|to_apply|body)=%?([\w.\-]+)", rest)
            if kind == "fusion":
                assert inner
                inside = bodies[inner[1]]
                reduces = any(x[1] == "reduce" for x in inside)
                size = max(elements(s) for s in ([shape, *(x[0] for x in inside)] if reduces else [shape]))
                work = sum(x[1] not in FREE for x in inside)
                total += size * work * (SCALAR if any(x[1] in JOINS for x in inside) else 1)
            elif kind in ("call", "while"):
                assert inner
                total += count(inner[1])
            elif kind not in FREE:
                total += elements(shape)
        return total

    return count(entry)


def cauchy() -> pl.dispersion.Cauchy:
    return pl.dispersion.Cauchy(pl.Free(1.3, 1.7), pl.Free(0, 20000))


def scene(layers: Any, signal: str = "R", angle: float = 0.0, **instrument: Any) -> pl.Scene:
    light = pl.Light(signal=signal, angle=angle)
    return pl.Scene(layers, "Si", light=light, instrument=pl.Instrument(**instrument))


THICKNESS = pl.Free(10, 1000)
ONE = pl.Layer(cauchy(), THICKNESS)
TWO = [ONE, pl.Layer("SiO2", pl.Free(0.5, 50))]


class Case(NamedTuple):
    """A scene, and limits of operations per wavelength and candidate: a fifth above those of jax 0.10."""

    scene: pl.Scene
    deviance: float
    jacobian: float


# sine and cosine of one phase are 50 operations, one polarisation of a layer 60 more; a slope costs about as
# much as its value, and there is one for each varying n or thickness, not for each parameter
CASES = {
    "R, thickness": Case(scene(pl.Layer("SiO2", THICKNESS)), 150, 460),
    "R, thickness and Cauchy": Case(scene(ONE), 160, 830),
    # twice 9 sums over the points; 150 are the signs of both curves at 7 positions, shared by 64 points
    "R, slow scale and offset": Case(
        scene(pl.Layer("SiO2", THICKNESS), scale="slow", offset="slow"), 460, 850
    ),
    # 1303 and 3102 with a trace of the optics for each number, whose fits took a quarter longer
    "R, two layers": Case(scene(TWO), 230, 1820),
    "R at 45 degrees, two layers": Case(scene(TWO, angle=45.0), 500, 4480),
    # with jnp.stack in place of stack_rows 775 and 3010, and 3620 and 23222 before amplitudes were stored
    "psi-delta, thickness and Cauchy": Case(scene(ONE, "psi-delta", 65.0), 650, 2880),
    # three slopes of both amplitudes; 17975 with complex matrices and a tangent for each parameter
    "psi-delta, two layers": Case(scene(TWO, "psi-delta", 65.0), 910, 5500),
}


def evaluations(scene: pl.Scene):
    """Deviance of candidates, and their residuals with the Jacobian, compiled."""
    problem = make(measured(pl.simulate(scene, np.linspace(400.0, 900.0, POINTS)), scene))
    [view] = problem.views
    size = len(problem.parameters)
    at = np.asarray(problem.values(np.random.default_rng(1).uniform(0.1, 0.9, (CANDIDATES, size))))

    def deviance(arrays, values):
        return jax.vmap(lambda value: view.form.explain(arrays, list(value)).deviance)(values)

    def jacobian(arrays, values):
        def one(value):
            rows, push = jax.linearize(lambda v: view.form.explain(arrays, list(v)).residual, value)
            return rows, jax.vmap(push)(jnp.eye(size))

        return jax.vmap(one)(values)

    return [
        operations(jax.jit(f).lower(view.arrays, at).compile()) / (CANDIDATES * POINTS)
        for f in (deviance, jacobian)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_nothing_is_computed_twice(name):
    case = CASES[name]
    deviance, jacobian = evaluations(case.scene)
    assert 50 < deviance <= case.deviance
    assert deviance < jacobian <= case.jacobian
