"""Writes gradient.json: Rs, Rp, Ts, Tp, N, C, S of hard graded layers and their derivatives, to 14 digits.

The truth shares nothing with the package: homogeneous slices with the index at their middles, whose error has
even powers of the thickness of a slice, extrapolated to no thickness (W. B. Gragg, 1965). Two extrapolations
must agree to 1e-15 before a number is written. Derivatives are differences of these numbers. Run as
`python tests/hard/make_gradient.py`; it takes some minutes.
"""

import json
from pathlib import Path

from mpmath import mp, mpc, mpf

mp.dps = 45
STEP = mpf(10) ** -8
SLICES = [2 * n for n in (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)]
SIGNALS = ("Rs", "Rp", "Ts", "Tp", "N", "C", "S")
NAMES = ("thickness", "top", "bottom", "shape", "angle")


def case(profile, first, second, numbers, substrate, ambient=1.0):
    """One row: `numbers` are those of NAMES (nm, fractions, degrees), `shape` as the profile takes it."""
    at = [float(x) for x in numbers]
    media = [[complex(x).real, complex(x).imag] for x in (first, second, substrate)]
    return {"profile": profile, "media": media, "ambient": float(ambient), "at": at}


CASES = {
    "linear on silicon": case("linear", 1.46, 2.0, (250, 0.2, 0.7, 1, 70), 3.9 + 0.02j),
    "linear, normal incidence": case("linear", 1.46, 2.0, (250, 0.2, 0.7, 1, 0.5), 3.9 + 0.02j),
    "exponential, absorbing": case("exponential", 1.9 + 0.01j, 1.6 + 0.4j, (300, 1, 0.1, 0.25, 60), 1.52),
    "parabolic on glass": case("power", 1.0, 1.52, (400, 0, 1, 2, 75), 1.52),
    "total reflection within": case("linear", 1.8, 1.2, (600, 0, 1, 1, 55), 1.2, 1.8),
    "metal from glass": case("linear", 1.5, 2.2 + 2.5j, (60, 0, 1, 1, 65), 1.5),
    "near grazing": case("exponential", 1.46, 2.1, (150, 0.3, 0.9, 0.5, 89), 3.9 + 0.02j),
}
NM = 550


def fraction(profile, top, bottom, shape, z):
    share = z
    if profile == "exponential":
        share = (1 - mp.exp(-z / shape)) / (1 - mp.exp(-1 / shape))
    if profile == "power":
        share = z**shape
    return top + (bottom - top) * share


def signals(row, values):
    """The seven signals of one case, extrapolated; by all slice counts and by all but the last."""
    thickness, top, bottom, shape, angle = values
    first, second, below = (mpc(*x) for x in row["media"])
    n0, k0 = mpf(row["ambient"]), 2 * mp.pi / NM
    a = n0 * mp.sin(angle * mp.pi / 180)

    def root(square):
        q = mp.sqrt(square)
        return -q if mp.im(q) < 0 else q

    amplitudes = []
    for letter in "sp":
        table = []
        for count in SLICES:
            h, product = thickness / count, mp.eye(2)
            for i in range(count):
                f = fraction(row["profile"], top, bottom, shape, (i + mpf(1) / 2) / count)
                e = first**2 + (second**2 - first**2) * f
                q, w = root(e - a * a), 1 if letter == "s" else e
                c, s = mp.cos(k0 * h * q), mp.sin(k0 * h * q)
                product *= mp.matrix([[c, -1j * s * w / q], [-1j * s * q / w, c]])
            table.append(product)
        for level in range(1, len(table)):
            for j in range(len(table) - 1, level - 1, -1):
                ratio = (mpf(SLICES[j]) / SLICES[j - level]) ** 2 - 1
                table[j] = table[j] + (table[j] - table[j - 1]) / ratio
            if level == len(table) - 2:
                other = table[-2].copy()
        assert mp.norm(table[-1] - other) < mpf(10) ** -15 * mp.norm(table[-1]), mp.norm(table[-1] - other)
        M, (w0, w2) = table[-1], (1, 1) if letter == "s" else (n0**2, below**2)
        q0, q2 = root(n0**2 - a * a) / w0, root(below**2 - a * a) / w2
        E, H = M[0, 0] + M[0, 1] * q2, M[1, 0] + M[1, 1] * q2
        amplitudes.append(((q0 * E - H) / (q0 * E + H), 4 * q0 * mp.re(q2) / abs(q0 * E + H) ** 2))
    (s, Ts), (p, Tp) = amplitudes
    size, cross = abs(s) ** 2 + abs(p) ** 2, 2 * mp.conj(p) * s
    # Δ near 180° for bare silicon: p in the convention of ellipsometry
    return [
        abs(s) ** 2,
        abs(p) ** 2,
        Ts,
        Tp,
        (abs(s) ** 2 - abs(p) ** 2) / size,
        mp.re(cross) / size,
        mp.im(cross) / size,
    ]


def main():
    rows = {}
    for name, row in CASES.items():
        at = [mpf(x) for x in row["at"]]
        values, slopes = signals(row, at), []
        for i in range(len(at)):
            step = STEP * max(abs(at[i]), 1)
            sides = [signals(row, [x + side * step * (i == j) for j, x in enumerate(at)]) for side in (1, -1)]
            slopes.append([(x - y) / (2 * step) for x, y in zip(*sides, strict=True)])
        rows[name] = row | {
            "values": [mp.nstr(x, 16) for x in values],
            "slopes": [[mp.nstr(x, 16) for x in each] for each in slopes],
        }
        print(name, flush=True)
    text = json.dumps({"signals": SIGNALS, "names": NAMES, "nm": NM, "rows": rows}, indent=1)
    Path(__file__).with_name("gradient.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
