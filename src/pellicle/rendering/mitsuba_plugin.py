"""BSDF `pellicle_film` for Mitsuba 3: facets whose Fresnel terms are those of a film, by lookup.

It needs Mitsuba, Dr.Jit and NumPy alone, so that the file can be copied beside a scene. Set a variant, call
`register()`, then load the scene:

    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")
    import pellicle_film
    pellicle_film.register()
    image = mi.render(mi.load_file("steel_film.xml"))

Parameters of the plugin:

- `filename`: the table, `.npz`.
- `thickness` in nm: a number, or a texture whose values from 0 to 1 run from `thickness_min` to
  `thickness_max`; the table's own thickness by default.
- `alpha`: roughness of GGX, a number or a texture; the number 0 for a mirror.
- `index_change`: added to the index of the film, a number or a texture; in RGB variants, and of several
  layers, where the table has two films.

All three are differentiable. In RGB variants the table has linear sRGB under D65, in spectral ones the film
at each wavelength, in monochromatic ones that at 550 nm; polarised variants get the Mueller matrices of its
waves. But for RGB, a film of one layer is computed by Airy's formula where light is polarised, where it
passes media without dispersion, and where thickness or index are not those of the table or have gradients.

A film on a transparent base transmits from both sides as the built-in `roughdielectric` does, with the same
medium on both sides (a bubble) straight on. Others reflect on the front side only, as `roughconductor` does;
wrap them in `twosided` for open surfaces.
"""

from typing import Any

import drjit
import mitsuba
import numpy as np

dr: Any = drjit
mi: Any = mitsuba  # its types change with the variant

NAME = "pellicle_film"
GREEN = 550.0
"""Wavelength (nm) of monochromatic variants."""


def table_texture(table: np.ndarray) -> Any:
    """Return a texture of a table whose last axis has the channels, linear between nodes."""
    kind = {2: mi.Texture1f, 3: mi.Texture2f, 4: mi.Texture3f}[table.ndim]
    return kind(
        mi.TensorXf(np.ascontiguousarray(table, np.float32)),
        filter_mode=dr.FilterMode.Linear,
        wrap_mode=dr.WrapMode.Clamp,
    )


def node(share: Any, count: int) -> Any:
    """Coordinate of a texture of `count` nodes whose first and last lie at 0 and 1."""
    return (share * (count - 1) + 0.5) / count


def register() -> None:
    """Register the BSDF for the current variant; repeat it after `mi.set_variant`."""
    mi.register_bsdf(NAME, _film())


def _init(film: Any, props: Any) -> None:
    mi.BSDF.__init__(film, props)
    with np.load(str(mi.file_resolver().resolve(props["filename"]))) as table:
        if "alone" not in table:
            raise ValueError(f"{props['filename']}: is of another version of pellicle; export the film again")
        film.span = [float(x) for x in table["thickness"]]
        own = float(table["default_thickness"])
        film.wavelength = [float(x) for x in table["wavelength"][[0, -1]]]
        film.eta = float(table["eta"])  # 0: it only reflects
        film.own, film.step, film.changed, film.fine = own, float(table["index_step"]), None, None
        film.table = film.values = film.media = None
        if table["alone"] and not mi.is_rgb:
            media = table["media"]  # only indices with dispersion are looked up
            film.same = [float(x[0]) if np.ptp(x) == 0 else None for x in media.T]
            varying = [i for i, x in enumerate(film.same) if x is None]
            film.media = table_texture(media[:, varying or [0]])
        else:
            film.values = _values(table, "", film.eta)
            film.table = table_texture(film.values)
        if not mi.is_rgb and not (film.media is not None and _quick(film)):
            film.fine = _values(table, "own_", film.eta)
        if f"changed_{'rgb' if mi.is_rgb else 'spectra'}" in table:
            film.changed = table_texture(_values(table, "changed_", film.eta))
            film.index = table_texture(table["media"][:, 1:2])
    film.low = float(props.get("thickness_min", 0.0))
    film.high = float(props.get("thickness_max", film.span[1]))
    film.thickness, film.alpha, film.index_change = (
        mi.Float(x) if isinstance(x, float) else x
        for x in (props.get("thickness", own), props.get("alpha", 0.1), props.get("index_change", 0.0))
    )
    _slice(film)
    film.smooth = isinstance(film.alpha, type(mi.Float(0))) and bool(np.all(np.array(film.alpha) == 0))
    film.straight = abs(film.eta - 1) < 1e-3
    varies = any(isinstance(x, mi.Texture) for x in (film.thickness, film.alpha, film.index_change))
    flags, varying = mi.BSDFFlags, mi.BSDFFlags.SpatiallyVarying if varies else 0
    sides = flags.FrontSide | flags.BackSide if film.eta else flags.FrontSide
    film.reflects = flags.DeltaReflection if film.smooth else flags.GlossyReflection
    through = flags.DeltaTransmission if film.smooth else flags.GlossyTransmission
    film.transmits = flags.Null if film.straight else through
    film.m_components = [film.reflects | sides | varying]
    if film.eta:
        film.m_components.append(
            film.transmits | sides | varying | (0 if film.straight else flags.NonSymmetric)
        )
    film.m_flags = film.m_components[0] | film.m_components[-1]


def _quick(film: Any) -> bool:
    """True where Airy's formula takes less time than a lookup at the film's own thickness.

    It does for the Mueller elements of both sides, and for indices without dispersion where light passes too.
    """
    return mi.is_polarized or bool(film.eta and None not in film.same)


def _values(table: Any, kind: str, eta: float) -> np.ndarray:
    """Table of a film (thicknesses, cosines, wavelengths, elements), in RGB (thicknesses, cosines, 3).

    Of the `kind` "own_" it is that of its own thickness and has no such axis.
    """
    sides = [_side(table, kind, side) for side in ("", "_transmitted", "_below") if eta or not side]
    return _both_sides(*sides) if eta else sides[0]


def _side(table: Any, kind: str, side: str) -> np.ndarray:
    if mi.is_rgb:
        return table[f"{kind}rgb{side}"]
    values = table[f"{kind}spectra{side}"][..., None]
    if not mi.is_polarized:
        return values
    if f"mueller{side}" not in table:
        raise RuntimeError("this film has no waves of one phase, which polarised variants need")
    return np.concatenate([values, table[f"{kind}mueller{side}"]], axis=-1)


def _both_sides(reflected: np.ndarray, passed: np.ndarray, below: np.ndarray) -> np.ndarray:
    """One table for one lookup: rows of light from above, then from below; transmission beside reflection."""
    rows = passed.ndim - 3 if not mi.is_rgb else 1  # the axis of the cosines
    total = np.zeros_like(np.delete(passed, 0, rows))  # all of which is reflected
    lower = np.concatenate([below, np.concatenate([total, passed], axis=rows)], axis=-1)
    return np.concatenate([np.concatenate([reflected, passed], axis=-1), lower], axis=rows)


def _slice(film: Any) -> None:
    """Tabulate an even film at its thickness: half of the nodes of a lookup, and finer ones at its own.

    RGB has one lookup for all channels, which gains nothing.
    """
    film.plane, change = None, film.index_change
    film.moved = isinstance(change, mi.Texture) or bool(np.any(np.array(change) != 0))
    if film.moved and not _has_index(film):
        raise RuntimeError("the table has one index: export a recipe in which that of the film is free")
    if film.fine is None or isinstance(film.thickness, mi.Texture):
        return
    nm = np.ravel(np.array(film.thickness))
    if len(nm) != 1:
        return
    (low, high), plane = film.span, film.fine
    if abs(nm[0] - film.own) > 1e-5 * film.own:
        if film.media is not None:
            return
        last = len(film.values) - 1
        at = np.clip((float(nm[0]) - low) / (high - low), 0, 1) * last
        row = min(int(at), last - 1)
        plane = (1 - at + row) * film.values[row] + (at - row) * film.values[row + 1]
    film.plane = table_texture(plane), (1, *plane.shape)


def _grid(film: Any) -> tuple[Any, tuple[int, ...]]:
    """The table to look up and its shape: that over all thicknesses for gradients and another index."""
    if film.plane is None or _moved(film) or dr.grad_enabled(film.thickness):
        return film.table, film.values.shape
    return film.plane


def _moved(film: Any) -> bool:
    """True where the index of the film is not that of the table, or its gradient is asked for."""
    return film.moved or (_has_index(film) and dr.grad_enabled(film.index_change))


def _has_index(film: Any) -> bool:
    """True where the index of the film can change."""
    return film.changed is not None or film.media is not None


def _parameters_changed(film: Any, keys: Any = ()) -> None:
    _slice(film)


def _number(value: Any, si: Any, active: Any) -> Any:
    return value.eval_1(si, active) if isinstance(value, mi.Texture) else value


def _thickness(film: Any, si: Any, active: Any) -> Any:
    """Thickness of the film in nm."""
    if not isinstance(film.thickness, mi.Texture):
        return film.thickness
    return film.low + (film.high - film.low) * film.thickness.eval_1(si, active)


def _waves(film: Any, nm: Any, cosine: Any, thickness: Any, change: Any, active: Any) -> list[list[Any]]:
    """Elements of reflection and of transmission by Airy's formula, at a wavelength `nm` in vacuum.

    With ε = n² and q = √(ε − n₀² sin²θ) those of a face are (q − q′)/(q + q′) for s, and for p
    (ε′ q − ε q′)/(ε′ q + ε q′). Numerators and denominators are kept apart, so that elements of both kinds
    share two divisions of real numbers.
    """
    number = mi.Complex2f
    n0, n, k, base_n, base_k = _indices(film, nm, active)
    square = n0**2 * (1 - cosine**2) * (dr.select(cosine < 0, film.eta**2, 1) if film.eta else 1)

    def medium(n: Any, k: Any, absorbs: bool) -> tuple[Any, Any]:
        """ε and q of a medium."""
        if absorbs:
            return number(n, k) ** 2, dr.sqrt(number(n, k) ** 2 - square)
        return number(n**2, 0), number(dr.safe_sqrt(n**2 - square), dr.safe_sqrt(square - n**2))

    above, layer, below = (
        medium(n0, None, False),
        medium(n + change, k, film.same[2] != 0),
        medium(base_n, base_k, film.same[4] != 0),
    )
    if film.eta:  # light from below meets them in the other order
        turned = [dr.select(cosine < 0, b, a) for a, b in zip(above, below, strict=True)]
        above, below = turned, [dr.select(cosine < 0, a, b) for a, b in zip(above, below, strict=True)]
    (e0, q0), (e1, q1), (e2, q2) = above, layer, below
    half = q1 * (2 * dr.pi * thickness / nm)
    root = number(dr.cos(dr.real(half)), dr.sin(dr.real(half))) * dr.exp(-dr.imag(half))
    faces = (
        ((q0 - q1, q0 + q1), (q1 - q2, q1 + q2)),
        ((e1 * q0 - e0 * q1, e1 * q0 + e0 * q1), (e2 * q1 - e1 * q2, e2 * q1 + e1 * q2)),
    )
    (s, whole_s), (p, whole_p) = (
        (r0 * t1 + t0 * r1 * root**2, t0 * t1 + r0 * r1 * root**2) for (r0, t0), (r1, t1) in faces
    )
    over_s, over_p = dr.rcp(dr.squared_norm(whole_s)), dr.rcp(dr.squared_norm(whole_p))
    turn = dr.conj(whole_s) * whole_p * (over_s * over_p)
    reflected = _pair(dr.squared_norm(s) * over_s, dr.squared_norm(p) * over_p, s * dr.conj(p) * turn)
    if not film.eta:
        return [reflected]
    flux = 16 * dr.squared_norm(q1 * root) * dr.maximum(dr.real(q0) * dr.real(q2), 0)
    both = dr.real(e0) * dr.real(e2)
    of_p = dr.squared_norm(e1) * both * over_p
    return [reflected, _pair(flux * over_s, flux * of_p, dr.conj(e1) * turn * (flux * dr.safe_sqrt(both)))]


def _pair(s: Any, p: Any, both: Any) -> list[Any]:
    """Elements of the squares of the amplitudes s and p, and of s times the conjugate of p."""
    return [(s + p) / 2, (s - p) / 2, dr.real(both), dr.imag(both)]


def _indices(film: Any, nm: Any, active: Any) -> list[Any]:
    """n of the ambient medium, n and k of the film and of the base at a wavelength in nm."""
    first, last = film.wavelength
    at = mi.Point1f(node((nm - first) / (last - first), film.media.shape[0]))
    found = iter(film.media.eval(at, active)) if None in film.same else iter(())
    return [next(found) if x is None else mi.Float(x) for x in film.same]


def _by_airy(film: Any, si: Any, cosine: Any, active: Any) -> tuple[list[Any], list[Any]]:
    """Elements of reflection and of transmission of a film of one layer: see `_light`."""
    thickness, change = _thickness(film, si, active), _number(film.index_change, si, active)
    count = 4 if mi.is_polarized else 1
    kinds = [[dr.zeros(mi.UnpolarizedSpectrum) for _ in range(count)] for _ in range(2)]
    for channel in range(len(kinds[0][0])):
        nm = si.wavelengths[channel] if mi.is_spectral else mi.Float(GREEN)
        for elements, values in zip(kinds, _waves(film, nm, cosine, thickness, change, active), strict=False):
            for element, value in zip(elements, values, strict=False):
                element[channel] = value
    return kinds[0], kinds[1]


def _elements(film: Any, si: Any, row: Any, square: Any, active: Any) -> list[Any]:
    """Elements of the film's Mueller matrices at a row of its table, a spectrum each.

    They are those of reflection, then of transmission; where light is not polarised m11 alone. `square` is
    that of the transverse index n sin θ. Another index is that between the films of two indices, each at the
    thickness that gives its waves the same phase: what is left to interpolate changes slowly.
    """
    nm, (table, shape) = _thickness(film, si, active), _grid(film)
    if not _moved(film):
        return _found(film, table, shape, si, row, lambda _: nm, active)
    change = _number(film.index_change, si, active)

    def path(n: Any) -> Any:
        return dr.sqrt(dr.maximum(n**2 - square, 1e-2))

    own, other = (
        _found(film, each, shape, si, row, lambda n, k=k: nm * path(n + change) / path(n + k), active)
        for each, k in ((table, 0.0), (film.changed, film.step))
    )
    share = change / film.step
    return [a + share * (b - a) for a, b in zip(own, other, strict=True)]


def _found(
    film: Any, table: Any, shape: tuple[int, ...], si: Any, row: Any, thickness: Any, active: Any
) -> list[Any]:
    """Elements at a row of a table of this shape; `thickness` (nm) is a function of the film's index."""
    (low, high), (first, last), across = film.span, film.wavelength, (row + 0.5) / shape[1]

    def down(share: Any) -> Any:
        """Coordinate of the thickness at a share of the range of wavelengths."""
        n = film.index.eval(mi.Point1f(node(share, film.index.shape[0])))[0] if _moved(film) else None
        return node((thickness(n) - low) / (high - low), shape[0])

    if mi.is_rgb:
        rgb = table.eval(mi.Point2f(across, down(mi.Float((GREEN - first) / (last - first)))), active)
        return [mi.Color3f(*rgb[at : at + 3]) for at in range(0, shape[2], 3)]
    values = [dr.zeros(mi.UnpolarizedSpectrum) for _ in range(shape[3])]
    for channel in range(len(values[0])):
        share = ((si.wavelengths[channel] if mi.is_spectral else mi.Float(GREEN)) - first) / (last - first)
        along = node(share, shape[2])
        at = mi.Point3f(along, across, down(share)) if shape[0] > 1 else mi.Point2f(along, across)
        found = table.eval(at, active)
        for value, element in zip(values, found, strict=True):
            value[channel] = element
    return values


def _light(film: Any, si: Any, cosine: Any, active: Any) -> tuple[list[Any], list[Any]]:
    """Elements of reflection and of transmission at a facet: `cosine` is negative for light from below."""
    own = film.plane is not None and not _moved(film) and not dr.grad_enabled(film.thickness)
    if film.media is not None and not own:
        return _by_airy(film, si, cosine, active)
    root, (_, shape) = dr.sqrt(dr.abs(cosine)), _grid(film)
    if not film.eta:
        reflected = _elements(film, si, root * (shape[1] - 1), 1 - cosine**2, active)
        return reflected, [dr.zeros(mi.UnpolarizedSpectrum)] * len(reflected)
    last = shape[1] // 3  # the row of the normal from above, and of the critical angle among those below
    square = 1 - film.eta**2 * (1 - cosine**2)  # of the cosine outside, for light from below
    total = dr.safe_acos(-cosine * film.eta / max(film.eta**2 - 1, 1e-6) ** 0.5)
    outside = dr.select(square > 0, dr.sqrt(dr.safe_sqrt(square)), -2 / dr.pi * total)
    row = dr.select(cosine < 0, 2 * last + 1 + last * outside, last * root)
    elements = _elements(film, si, row, (1 - cosine**2) * dr.select(cosine < 0, film.eta**2, 1), active)
    half = len(elements) // 2
    return elements[:half], elements[half:]


def _value(ctx: Any, wi: Any, wo: Any, normal: Any, elements: list[Any], weight: Any) -> Any:
    """Elements times a weight: a spectrum, or a Mueller matrix between the bases of both directions."""
    if len(elements) == 1:
        return elements[0] * weight
    a, b, c, s = (x * weight for x in elements)
    zero = dr.zeros(mi.UnpolarizedSpectrum)
    matrix = mi.Spectrum([[a, b, zero, zero], [b, a, zero, zero], [zero, zero, c, -s], [zero, zero, s, c]])
    # Mitsuba counts time the other way, so m34 changes its sign
    # light arrives along -source and leaves along seen
    source, seen = (wo, wi) if ctx.mode == mi.TransportMode.Radiance else (wi, wo)
    axes = [dr.cross(normal, x) for x in (-source, seen)]
    axes = [dr.select(dr.squared_norm(x) < 1e-12, mi.Vector3f(1, 0, 0), dr.normalize(x)) for x in axes]
    basis = mi.mueller.stokes_basis
    return mi.mueller.rotate_mueller_basis(
        *(matrix, -source, axes[0], basis(-source), seen, axes[1], basis(seen))
    )


def _facets(film: Any, si: Any, active: Any) -> Any:
    return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, _number(film.alpha, si, active))


def _chance(reflected: list[Any], passed: list[Any]) -> Any:
    """Share of samples that are reflected."""
    r, t = dr.mean(reflected[0]), dr.mean(passed[0])
    return dr.select(t > 0, r / dr.maximum(r + t, 1e-9), 1)


def _sample(film: Any, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
    bs = mi.BSDFSample3f()
    cosine = mi.Frame3f.cos_theta(si.wi)
    active = active & ((cosine != 0) if film.eta else (cosine > 0))
    facets: Any = None
    normal, pdf, weight = mi.Normal3f(0, 0, 1), mi.Float(1), mi.Float(1)
    flat: Any = _light(film, si, cosine, active) if film.smooth or film.straight else None
    if not film.smooth:
        facets = _facets(film, si, active)
        normal, pdf = facets.sample(dr.mulsign(mi.Vector3f(si.wi), cosine), sample2)
        active = active & (pdf > 0)
    at = dr.dot(si.wi, normal)
    reflected, passed = flat if film.smooth else _light(film, si, at, active)
    if film.straight:
        passed = flat[1]  # straight on, whatever the facet
    chance = _chance(*(flat or (reflected, passed)))
    mirrored = sample1 <= chance
    bs.wo = mi.reflect(si.wi, normal)
    bs.eta, through = mi.Float(1), -si.wi
    turn, scale = 1 / (4 * dr.dot(bs.wo, normal)), mi.Float(1)
    if film.eta and not film.straight:
        _, cosine_t, eta_it, eta_ti = mi.fresnel(at, film.eta)
        through = mi.refract(si.wi, normal, cosine_t, eta_ti)
        bs.eta = dr.select(mirrored, 1, eta_it)
        towards = dr.dot(through, normal)
        turn = dr.select(mirrored, turn, eta_it**2 * towards / (at + eta_it * towards) ** 2)
        if ctx.mode == mi.TransportMode.Radiance:
            scale = dr.select(mirrored, 1, eta_ti**2)
    bs.wo = dr.select(mirrored, bs.wo, through)
    bs.sampled_component = dr.select(mirrored, mi.UInt32(0), mi.UInt32(1))
    bs.sampled_type = dr.select(mirrored, mi.UInt32(+film.reflects), mi.UInt32(+film.transmits))
    if facets is not None:
        rough = mirrored | (not film.straight)
        pdf = dr.select(rough, pdf * dr.abs(turn), 1)
        weight = dr.select(rough, facets.smith_g1(bs.wo, normal), 1)
    bs.pdf = pdf * dr.select(mirrored, chance, 1 - chance)
    # a mirrored direction below the surface, and a transmitted one above it, carry no light
    active = active & ((mi.Frame3f.cos_theta(bs.wo) * cosine > 0) == mirrored) & (bs.pdf > 0)
    elements = [dr.select(mirrored, r, t) for r, t in zip(reflected, passed, strict=True)]
    weight = weight * scale / dr.select(mirrored, chance, 1 - chance)
    return bs, _value(ctx, si.wi, bs.wo, normal, elements, weight) & active


def _eval(film: Any, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
    return _eval_pdf(film, ctx, si, wo, active)[0]


def _pdf(film: Any, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
    return _eval_pdf(film, ctx, si, wo, active)[1]


def _eval_pdf(film: Any, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
    if film.smooth:
        return dr.zeros(mi.Spectrum), mi.Float(0)
    wi, cosine, leaving = si.wi, mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
    above, through = cosine * leaving > 0, bool(film.eta) and not film.straight
    active = active & (cosine * leaving != 0) & (True if through else above)
    eta = dr.select(cosine > 0, film.eta, 1 / film.eta) if through else mi.Float(1)
    normal = dr.normalize(wi + wo * dr.select(above, 1, eta))
    normal = dr.mulsign(normal, mi.Frame3f.cos_theta(normal))
    at, towards = dr.dot(wi, normal), dr.dot(wo, normal)
    active = active & (at * cosine > 0) & (towards * leaving > 0)
    active = active & (True if film.eta else (cosine > 0))
    facets = _facets(film, si, active)
    light = _light(film, si, at, active)
    chance = _chance(*(_light(film, si, cosine, active) if film.straight else light))
    turn, seen = dr.abs(1 / (4 * towards)), dr.abs(1 / (4 * cosine))
    if through:
        jacobian = dr.abs(eta**2 * towards / (at + eta * towards) ** 2)
        scale = eta**-2 if ctx.mode == mi.TransportMode.Radiance else 1
        seen = dr.select(above, seen, jacobian * dr.abs(at / cosine) * scale)
        turn = dr.select(above, turn, jacobian)
    density, masked = facets.eval(normal), facets.smith_g1(wi, normal)
    weight = density * masked * facets.smith_g1(wo, normal) * seen
    elements = [dr.select(above, r, t) for r, t in zip(*light, strict=True)]
    pdf = density * masked * dr.abs(at / cosine) * turn * dr.select(above, chance, 1 - chance)
    return _value(ctx, wi, wo, normal, elements, weight) & active, dr.select(active, pdf, 0)


def _traverse(film: Any, callback: Any) -> None:
    for name in ("thickness", "alpha", *(["index_change"] if _has_index(film) else [])):
        value = getattr(film, name)
        if isinstance(value, mi.Texture) or dr.is_jit_v(mi.Float):
            callback.put(name, value, mi.ParamFlags.Differentiable)


def _to_string(film: Any) -> str:
    return f"{NAME}[alpha = {film.alpha}, eta = {film.eta:g}]"


def _film() -> Any:
    """The class of the BSDF, made for the current variant."""

    class PellicleFilm(mi.BSDF):
        __init__ = _init
        sample = _sample
        eval = _eval
        pdf = _pdf
        eval_pdf = _eval_pdf
        traverse = _traverse
        parameters_changed = _parameters_changed
        to_string = _to_string

    return PellicleFilm
