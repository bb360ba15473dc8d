"""Writes anisotropic.json: Jones matrices and transmittances of hard birefringent films, to 50 digits.

The four waves of each medium are eigenvectors of Berreman's matrix at 160 digits, and their amplitudes obey
the continuity of the tangential fields at both faces: eight linear equations in which nothing grows. Every
medium is changed by 1e-50, so that no waves are equal. Derivatives are central differences. Run as
`python tests/hard/make_anisotropic.py`; it takes a minute.
"""

import json
from pathlib import Path

from mpmath import mp, mpc, mpf
from stack_truth import differences

NUDGE = mpf(10) ** -50

PARAMETERS = (
    *("thickness", "ordinary_n", "ordinary_k", "extraordinary_n", "extraordinary_k", "theta", "phi"),
    *("substrate_ordinary", "substrate_extraordinary", "substrate_k", "substrate_theta", "substrate_phi"),
    *("ambient", "angle", "wavelength"),
)


def case(
    thickness=237.0,
    ordinary=1.66,
    extraordinary=1.49,
    axis=(40.0, 25.0),
    substrate=(1.52, 1.52),
    substrate_k=0.0,
    substrate_axis=(0.0, 0.0),
    ambient=1.0,
    angle=55.0,
    wavelength=550.0,
    smooth=True,
):
    """One row: the exact floats of PARAMETERS, and whether the derivatives exist."""
    o, e = complex(ordinary), complex(extraordinary)
    media = (o.real, o.imag, e.real, e.imag, *axis, *substrate, substrate_k, *substrate_axis)
    return {"at": [thickness, *media, ambient, angle, wavelength], "smooth": smooth}


CRYSTAL = {"substrate": (1.77, 1.68), "substrate_axis": (60.0, 110.0)}
CASES = {
    "ordinary": case(),
    "ordinary, absorbing": case(ordinary=1.9 + 0.2j, extraordinary=1.6 + 0.05j, substrate=(3.9, 3.9)),
    "crystal on crystal": case(**CRYSTAL),
    "absorbing crystal on absorbing crystal": case(ordinary=1.9 + 0.2j, substrate_k=0.3, **CRYSTAL),
    "normal incidence": case(angle=0.0),
    "normal incidence, axis along the normal": case(angle=0.0, axis=(0.0, 0.0)),
    "axis along the normal": case(axis=(0.0, 0.0)),
    "axis in the surface": case(axis=(90.0, 35.0)),
    "n_o = n_e": case(extraordinary=1.66),
    "n_o = n_e, absorbing": case(ordinary=1.9 + 0.2j, extraordinary=1.9 + 0.2j),
    "birefringence 1e-9": case(extraordinary=1.66 + 1e-9),
    "birefringence 1e-9, 1 mm": case(extraordinary=1.66 + 1e-9, thickness=1e6),
    "axis along the ray": case(ambient=1.5, angle=30.0, ordinary=1.5, axis=(30.0, 0.0)),
    "axis nearly along the ray": case(ambient=1.5, angle=30.0, ordinary=1.5, axis=(30.01, 0.01)),
    "axis along the reflected ray": case(ambient=1.5, angle=30.0, ordinary=1.5, axis=(30.0, 180.0)),
    "axis along the ray in the substrate": case(
        ambient=1.5, angle=30.0, substrate=(1.5, 1.7), substrate_axis=(30.0, 0.0)
    ),
    "substrate with n_o = n_e": case(substrate=(1.7, 1.7), substrate_axis=(30.0, 20.0)),
    "zero thickness": case(thickness=0.0),
    "thickness 1e-6 nm": case(thickness=1e-6, ordinary=1.9 + 0.2j),
    "89.999 degrees": case(angle=89.999),
    "exactly 90 degrees": case(angle=90.0),
    "ordinary wave critical": case(ambient=1.5, angle=30.0, ordinary=0.75),
    "extraordinary wave critical": case(ambient=1.5, angle=30.0, extraordinary=0.75, axis=(90.0, 90.0)),
    "both waves critical": case(ambient=1.5, angle=30.0, ordinary=0.75, extraordinary=0.75),
    "both waves critical, 10 µm": case(
        ambient=1.5, angle=30.0, ordinary=0.75, extraordinary=0.75, thickness=1e4
    ),
    "nearly critical, birefringence 1e-6": case(
        ambient=1.5, angle=30.0, ordinary=0.7500001, extraordinary=0.750001
    ),
    "evanescent": case(ambient=1.8, angle=75.0, substrate=(1.8, 1.8)),
    "20 µm, ordinary evanescent": case(
        ambient=1.8, angle=60.0, thickness=2e4, ordinary=1.3, extraordinary=1.7, substrate=(1.8, 1.8)
    ),
    "total reflection in the substrate": case(
        ambient=1.8, angle=65.0, substrate=(1.5, 1.4), substrate_axis=(50.0, 20.0)
    ),
    "substrate between both critical angles": case(
        ambient=1.8, angle=60.0, substrate=(1.5, 1.7), substrate_axis=(90.0, 70.0)
    ),
    "metal": case(thickness=30.0, ordinary=0.05 + 4j, extraordinary=0.2 + 3j),
    "1 mm of k = 3": case(thickness=1e6, ordinary=2.9 + 3j, extraordinary=2.5 + 3j),
    "1 mm transparent": case(thickness=1e6),
    "ordinary wave e^-1000": case(thickness=3e4, ordinary=1.6 + 3j, extraordinary=1.5),
    "extraordinary wave e^-1000": case(thickness=3e4, ordinary=1.5, extraordinary=1.6 + 3j),
    "extraordinary wave e^-1000, axis in the surface": case(
        thickness=3e4, ordinary=1.5, extraordinary=1.6 + 3j, axis=(90.0, 40.0), **CRYSTAL
    ),
    "polariser e^-4": case(
        thickness=3000.0, ordinary=1.5 + 1e-4j, extraordinary=1.6 + 0.12j, axis=(90.0, 30.0)
    ),
    "k = 1e-12": case(ordinary=1.66 + 1e-12j, extraordinary=1.49 + 1e-12j),
    "dense ambient": case(ambient=1.52, angle=40.0, substrate=(1.7, 1.7)),
    "wavelength 1e7 nm": case(wavelength=1e7, ordinary=1.9 + 0.2j),
}


def permittivity(ordinary, extraordinary, theta, phi):
    """ε_o + (ε_e − ε_o) c cᵀ, angles in degrees."""
    theta, phi = theta * mp.pi / 180, phi * mp.pi / 180
    c = [mp.sin(theta) * mp.cos(phi), mp.sin(theta) * mp.sin(phi), mp.cos(theta)]
    eo, ee = ordinary**2, extraordinary**2
    return mp.matrix(3, 3) + mp.matrix(
        [[(eo if i == j else 0) + (ee - eo) * c[i] * c[j] for j in range(3)] for i in range(3)]
    )


def waves(e, a):
    """(q, fields) of the four waves, those downwards first."""
    z = [-e[2, 0] / e[2, 2], -a / e[2, 2], -e[2, 1] / e[2, 2], 0]  # Ez of (Ex, Hy, Ey, −Hx)

    def displacement(i):
        row = [e[i, 2] * x for x in z]
        row[0] += e[i, 0]
        row[2] += e[i, 1]
        return row

    first = [a * x for x in z]
    first[1] += 1
    last = displacement(1)
    last[2] -= a * a
    values, vectors = mp.eig(mp.matrix([first, displacement(0), [0, 0, 0, 1], last]))
    found = []
    for j in range(4):
        v = [vectors[i, j] for i in range(4)]
        size = max(abs(x) for x in v)
        v = [x / size for x in v]
        flux = mp.re(v[0] * mp.conj(v[1]) + v[2] * mp.conj(v[3]))
        real = abs(mp.im(values[j])) < mpf(10) ** -38
        found.append((flux if real else mp.im(values[j]), values[j], v))
    found.sort(key=lambda wave: -wave[0])
    return [wave[1:] for wave in found]


def outputs(p):
    """Re and Im of r_pp, r_ps, r_sp, r_ss, then T of p and of s."""
    d, no, ko, ne, ke, theta, phi, so, se, sk, theta_s, phi_s, n0, angle, wavelength = p
    angle = angle * mp.pi / 180
    cosine = mp.cos(angle)
    a, q0, k = n0 * mp.sin(angle), n0 * cosine, 2 * mp.pi * d / wavelength
    # equal waves have no four eigenvectors: everything is nudged apart
    layer = permittivity(mpc(no, ko), mpc(ne, ke) + NUDGE, theta + NUDGE * 3, phi + NUDGE * 7)
    layer[0, 0] += NUDGE * mpf("1.3")
    layer[1, 1] -= NUDGE * mpf("0.7")
    below = permittivity(mpc(so, sk), mpc(se, sk) + NUDGE * 2, theta_s + NUDGE * 5, phi_s + NUDGE * 11)
    below[0, 0] += NUDGE * mpf("0.9")
    inside, substrate = waves(layer, a), waves(below, a)
    p_up, s_up = (-cosine, n0, 0, 0), (0, 0, 1, -q0)
    p_down, s_down = (cosine, n0, 0, 0), (0, 0, 1, q0)
    system, right = mp.matrix(8, 8), mp.matrix(8, 2)
    for i in range(4):
        system[i, 0], system[i, 1] = p_up[i], s_up[i]
        right[i, 0], right[i, 1] = -mpf(p_down[i]), -mpf(s_down[i])
        for j, (q, v) in enumerate(inside):
            phase = mp.exp(1j * k * q) if j < 2 else mp.exp(-1j * k * q)
            system[i, 2 + j] = -v[i] * (1 if j < 2 else phase)
            system[4 + i, 2 + j] = v[i] * (phase if j < 2 else 1)
        for j in range(2):
            system[4 + i, 6 + j] = -substrate[j][1][i]
    found = [mp.lu_solve(system, right[:, j]) for j in range(2)]
    jones = [found[0][0], found[1][0], found[0][1], found[1][1]]
    powers = []
    for x in found:
        Ex, Hy, Ey, Hx = (sum(x[6 + j] * substrate[j][1][i] for j in range(2)) for i in range(4))
        powers.append(mp.re(Ex * mp.conj(Hy) + Ey * mp.conj(Hx)) / q0)
    return [part(r) for r in jones for part in (mp.re, mp.im)] + powers


def row(given):
    p = [mpf(x) for x in given["at"]]
    out = {"at": given["at"], "smooth": given["smooth"], "value": [float(x) for x in outputs(p)]}
    if given["smooth"]:
        out["slope"] = [[float(x) for x in column] for column in differences(outputs, p)]
    return out


def main():
    table = {"parameters": PARAMETERS, "cases": {name: row(given) for name, given in CASES.items()}}
    path = Path(__file__).with_name("anisotropic.json")
    path.write_text(json.dumps(table, indent=None, separators=(",", ":")) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
