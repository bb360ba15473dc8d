"""Truth of tables: signals of stacks by two formulas that share nothing but Snell's law, to 160 digits.

They are the product of characteristic matrices (H. A. Macleod, Thin-Film Optical Filters, chapter 2) and the
recursion over reflections (P. Rouard, 1937; for one film the sum of G. B. Airy, 1833), and must agree to
1e-40 before a number is written. Parameters of a stack are its thicknesses, n and k of its layers, n and k of
the substrate, n of the ambient, the angle and the wavelength.
"""

from mpmath import mp, mpc, mpf

mp.dps = 160
STEP = mpf(10) ** -40  # of the central difference: its error is of order 1e-80
NUDGE = mpf(10) ** -90  # of an index whose root is exactly 0, where both formulas are 0/0
AGREEMENT = mpf(10) ** -40


def root(square, near=None):
    """√ with Im ≥ 0, or the root on the side of `near`: a derivative stays on one branch."""
    q = mp.sqrt(square)
    if near is not None:
        return q if abs(q - near) <= abs(q + near) else -q
    return -q if mp.im(q) < 0 else q


def unpack(p, near):
    """Depths, permittivities from the ambient to the substrate, normal components of the index, k₀."""
    count = (len(p) - 5) // 3
    depth, n, k = p[:count], p[count : 2 * count], p[2 * count : 3 * count]
    n2, k2, n0, angle, wavelength = p[-5:]
    theta = angle * mp.pi / 180
    a = n0 * mp.sin(theta)
    eps = [n0**2, *(mpc(*nk) ** 2 for nk in zip(n, k, strict=True)), mpc(n2, k2) ** 2]
    # a root that is exactly 0 makes both formulas 0/0
    eps = [eps[0], *(e + NUDGE if abs(e - a * a) < NUDGE else e for e in eps[1:])]
    q = [n0 * mp.cos(theta), *(root(e - a * a) for e in eps[1:-1]), root(eps[-1] - a * a, near)]
    return depth, eps, q, 2 * mp.pi / wavelength


def by_matrix(p, near=None):
    """r and T of s and p."""
    depth, eps, q, k0 = unpack(p, near)
    result = {}
    for letter in "sp":
        y = q if letter == "s" else [normal / e for normal, e in zip(q, eps, strict=True)]
        electric, magnetic = mpf(1), y[-1]
        for d, normal, tilted in reversed(list(zip(depth, q[1:-1], y[1:-1], strict=True))):
            cosine, sine = mp.cos(k0 * d * normal), -1j * mp.sin(k0 * d * normal)
            electric, magnetic = (
                cosine * electric + sine / tilted * magnetic,
                tilted * sine * electric + cosine * magnetic,
            )
        below = y[0] * electric + magnetic
        result[letter] = (y[0] * electric - magnetic) / below, 4 * y[0] * mp.re(y[-1]) / abs(below) ** 2
    return result


def by_recursion(p, near=None):
    """The same, face by face from the bottom, with Fresnel's coefficients."""
    depth, eps, q, k0 = unpack(p, near)
    result = {}
    for letter in "sp":
        # in p the magnetic field carries the amplitude
        y = q if letter == "s" else [normal / e for normal, e in zip(q, eps, strict=True)]
        r = t = None
        for i in range(len(q) - 2, -1, -1):
            face, into = (y[i] - y[i + 1]) / (y[i] + y[i + 1]), 2 * y[i] / (y[i] + y[i + 1])
            if r is None:
                r, t = face, into
                continue
            passage = mp.exp(1j * k0 * depth[i] * q[i + 1])
            echoes = 1 + face * r * passage**2
            r, t = (face + r * passage**2) / echoes, into * t * passage / echoes
        result[letter] = r, abs(t) ** 2 * mp.re(y[-1]) / y[0]
    return result


def agree(name, ones, others):
    for one, two in zip(ones, others, strict=True):
        if abs(one - two) > AGREEMENT * (1 + abs(one)):
            raise SystemExit(f"{name}: the formulas differ by {mp.nstr(abs(one - two), 3)}")


def differences(function, p):
    """[parameter][output], central differences: their error is of order 1e-80."""
    table = []
    for i in range(len(p)):
        up, down = list(p), list(p)
        up[i], down[i] = p[i] + STEP, p[i] - STEP
        table.append([(x - y) / (2 * STEP) for x, y in zip(function(up), function(down), strict=True)])
    return table


def conditions(function, p, floors, sizes):
    """[parameter][output]: `floors` and by how much a slope changes where every input changes by its size."""
    bends = [list(column) for column in floors]
    for j, size in enumerate(sizes):
        if size == 0:
            continue
        up, down = list(p), list(p)
        up[j], down[j] = p[j] + STEP, p[j] - STEP
        for column, x, y in zip(bends, differences(function, up), differences(function, down), strict=True):
            for i in range(len(column)):
                column[i] += size * abs(x[i] - y[i]) / (2 * STEP)
    return [[float(f"{float(x):.3g}") for x in column] for column in bends]
