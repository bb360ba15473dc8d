"""Random stacks of isotropic and birefringent layers, and their Jones matrices to 50 digits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from mpmath import mp, mpc, mpf

FAMILIES = ("transparent", "absorbing", "opaque")
MOST = 4
"""Most layers of a stack."""


class Stack(NamedTuple):
    """One stack: the media from the first layer to the substrate."""

    family: str
    indices: list[list[complex]]  # principal indices of each medium
    turns: list[list[float]]  # Euler angles θ, φ, ψ of each medium in degrees
    depths: list[float]  # nm
    ambient: float
    angle: float  # degrees
    wavelength: float  # nm

    @property
    def is_uniaxial(self) -> bool:
        """True if no medium is biaxial."""
        return all(n[0] == n[1] for n in self.indices)

    @property
    def is_isotropic(self) -> bool:
        """True if no medium is birefringent."""
        return all(n[0] == n[1] == n[2] for n in self.indices)


def random_stacks(count: int, seed: int = 1) -> list[Stack]:
    """Return random stacks, of each family a third.

    One to four layers and a substrate, each isotropic, uniaxial or biaxial (a third of the stacks has no
    birefringent medium, a third no biaxial one); principal indices of 1.2 to 2.8, extinctions of 1e-5 to 1;
    layers of up to 500 nm, and one of up to 20 µm in an opaque stack; 0 to 89 degrees.
    """
    rng = np.random.default_rng(seed)
    return [_random_stack(FAMILIES[i % 3], rng) for i in range(count)]


def _random_stack(family: str, rng: np.random.Generator) -> Stack:
    layers, kinds = int(rng.integers(1, MOST + 1)), int(rng.integers(1, 4))
    indices, turns = [], []
    for _ in range(layers + 1):
        n = rng.uniform(1.2, 2.8, 3) + 0j
        if family != "transparent" and rng.random() < 0.7:
            n += 1j * 10 ** rng.uniform(-5, 0, 3)
        kind = rng.integers(kinds)
        indices.append([[n[0]] * 3, [n[0], n[0], n[1]], n.tolist()][kind])
        turns.append([rng.uniform(0, 180), rng.uniform(0, 360), rng.uniform(0, 360)])
    depths = rng.uniform(0, 500, layers)
    if family == "opaque":
        depths[rng.integers(layers)] = 10 ** rng.uniform(3, np.log10(2e4))
    indices = [[complex(x) for x in n] for n in indices]
    light = float(rng.uniform(1, 1.8)), float(rng.uniform(0, 89)), float(rng.uniform(400, 800))
    return Stack(family, indices, turns, depths.tolist(), *light)


def jones_matrix(stack: Stack, digits: int = 50) -> np.ndarray:
    """Return ((r_pp, r_ps), (r_sp, r_ss)) from exponentials of Berreman's matrices, correctly rounded.

    The precision is higher by the digits that waves which grow take.
    """
    nepers = sum(
        2 * np.pi * d / stack.wavelength * 2 * max(1.0, *np.abs(n))
        for n, d in zip(stack.indices, stack.depths, strict=False)
        if any(x.imag for x in n) or stack.ambient > 1.2
    )
    with mp.workdps(int(digits + 20 + nepers / 2.3)):
        angle = mpf(stack.angle) * mp.pi / 180
        a, cosine = stack.ambient * mp.sin(angle), mp.cos(angle)
        *layers, substrate = [_delta(*medium, a) for medium in zip(stack.indices, stack.turns, strict=True)]
        n = stack.indices[-1]
        fields = _isotropic_waves(n[0], a) if n[0] == n[1] == n[2] else _waves(substrate)
        for matrix, depth in reversed(list(zip(layers, stack.depths, strict=True))):
            fields = _exponential(matrix * (-2j * mp.pi * mpf(depth) / mpf(stack.wavelength))) * fields
        n0, q0 = stack.ambient, stack.ambient * cosine
        ambient = mp.matrix([[cosine, 0, -cosine, 0], [n0, 0, n0, 0], [0, 1, 0, 1], [0, q0, 0, -q0]])
        amplitudes = mp.lu_solve(ambient, fields[:, 0]), mp.lu_solve(ambient, fields[:, 1])
        down, up = (mp.matrix([[x[i], y[i]], [x[i + 1], y[i + 1]]]) for i in (0, 2) for x, y in [amplitudes])
        return np.array((up * mp.inverse(down)).tolist(), dtype=complex)


def _delta(indices: Any, turns: Any, a: Any) -> Any:
    """Berreman's matrix for (Ex, Hy, Ey, −Hx)."""
    theta, phi, psi = (mpf(x) * mp.pi / 180 for x in turns)

    def about_z(angle: Any) -> Any:
        c, s = mp.cos(angle), mp.sin(angle)
        return mp.matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])

    c, s = mp.cos(theta), mp.sin(theta)
    turn = about_z(phi) * mp.matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]]) * about_z(psi)
    e = turn * mp.diag([mpc(n) ** 2 for n in indices]) * turn.T
    z = [-e[2, 0] / e[2, 2], -a / e[2, 2], -e[2, 1] / e[2, 2], mpf(0)]  # Ez

    def row(i: int) -> list[Any]:
        return [e[i, 0] + e[i, 2] * z[0], e[i, 2] * z[1], e[i, 1] + e[i, 2] * z[2], mpf(0)]

    first, last = [a * x for x in z], row(1)
    first[1] += 1
    last[2] -= a * a
    return mp.matrix([first, row(0), [0, 0, 0, 1], last])


def _exponential(matrix: Any) -> Any:
    """Taylor's series of a small part, squared."""
    halvings = max(0, int(mp.ceil(mp.log(mp.mnorm(matrix, 1) + 1, 2)))) + 16
    small, term, total, n = matrix / mpf(2) ** halvings, mp.eye(4), mp.eye(4), 0
    while mp.mnorm(term, 1) > mp.eps * mpf(2) ** -halvings:
        n += 1
        term = term * small / n
        total = total + term
    for _ in range(halvings):
        total = total * total
    return total


def _waves(matrix: Any) -> Any:
    """Fields of the two downward waves in the columns of a matrix (4, 2)."""
    values, vectors = mp.eig(matrix)

    def outward(j: int) -> Any:
        v = [vectors[i, j] for i in range(4)]
        if abs(mp.im(values[j])) > mpf(10) ** -30:
            return mp.im(values[j])
        return mp.re(v[0] * mp.conj(v[1]) + v[2] * mp.conj(v[3]))

    down = sorted(range(4), key=outward)[2:]
    return mp.matrix([[vectors[i, j] for j in down] for i in range(4)])


def _isotropic_waves(n: complex, a: Any) -> Any:
    q = mp.sqrt(mpc(n) ** 2 - a * a)
    q = -q if mp.im(q) < 0 else q
    return mp.matrix([[q, 0], [mpc(n) ** 2, 0], [0, 1], [0, q]])
