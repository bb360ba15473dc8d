"""BSDF `pellicle_film` for Mitsuba 3: facets whose Fresnel term is the reflectance of a film, by lookup.

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
- `alpha`: roughness of GGX; 0 for a mirror.

In RGB variants the table has linear sRGB under D65, in spectral ones the reflectance at each wavelength. Like
the built-in `roughconductor` it reflects on the front side only; wrap it in `twosided` for open surfaces.
"""

from typing import Any

import drjit
import mitsuba
import numpy as np

dr: Any = drjit
mi: Any = mitsuba  # its types change with the variant

NAME = "pellicle_film"


def table_texture(table: np.ndarray) -> Any:
    """Return a texture of a table whose last axis has the channels, linear between nodes."""
    kind = mi.Texture2f if table.ndim == 3 else mi.Texture3f
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
        film.span = [float(x) for x in table["thickness"]]
        own = float(table["default_thickness"])
        values = table["spectra" if mi.is_spectral else "rgb"]
        film.wavelength = [float(x) for x in table["wavelength"][[0, -1]]]
    film.shape = values.shape  # thicknesses, cosines, channels or wavelengths
    film.texture = table_texture(values[..., None] if mi.is_spectral else values)
    film.alpha = float(props.get("alpha", 0.1))
    film.low = float(props.get("thickness_min", 0.0))
    film.high = float(props.get("thickness_max", film.span[1]))
    film.thickness = props.get("thickness", own)
    lobe = mi.BSDFFlags.GlossyReflection if film.alpha > 0 else mi.BSDFFlags.DeltaReflection
    varies = 0 if isinstance(film.thickness, float) else mi.BSDFFlags.SpatiallyVarying
    film.m_components = [lobe | mi.BSDFFlags.FrontSide | varies]
    film.m_flags = film.m_components[0]
    film.flag = lobe


def _reflectance(film: Any, si: Any, cosine: Any, active: Any) -> Any:
    """Reflectance of the film at a cosine of the angle of incidence."""
    nm = film.thickness
    if not isinstance(nm, float):
        nm = film.low + (film.high - film.low) * nm.eval_1(si, active)
    across = node(cosine, film.shape[1])
    down = node((nm - film.span[0]) / (film.span[1] - film.span[0]), film.shape[0])
    if not mi.is_spectral:
        rgb = film.texture.eval(mi.Point2f(across, down), active)
        return mi.Color3f(rgb[0], rgb[1], rgb[2])
    first, last = film.wavelength
    value = dr.zeros(mi.UnpolarizedSpectrum)
    for channel in range(len(value)):
        share = (si.wavelengths[channel] - first) / (last - first)
        at = mi.Point3f(node(share, film.shape[2]), across, down)
        value[channel] = film.texture.eval(at, active)[0]
    return value


def _facets(film: Any) -> Any:
    return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, film.alpha)


def _sample(film: Any, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
    bs = mi.BSDFSample3f()
    cosine = mi.Frame3f.cos_theta(si.wi)
    active = active & (cosine > 0)
    bs.eta = 1.0
    bs.sampled_component = mi.UInt32(0)
    bs.sampled_type = mi.UInt32(+film.flag)
    if film.alpha == 0:
        bs.wo = mi.reflect(si.wi)
        bs.pdf = mi.Float(1.0)
        return bs, _reflectance(film, si, cosine, active) & active
    facets = _facets(film)
    m, pdf = facets.sample(si.wi, sample2)
    bs.wo = mi.reflect(si.wi, m)
    active = active & (pdf > 0) & (mi.Frame3f.cos_theta(bs.wo) > 0)
    bs.pdf = pdf / (4 * dr.dot(bs.wo, m))
    weight = facets.smith_g1(bs.wo, m)
    return bs, (_reflectance(film, si, dr.dot(si.wi, m), active) * weight) & active


def _eval(film: Any, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
    return _eval_pdf(film, ctx, si, wo, active)[0]


def _pdf(film: Any, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
    if film.alpha == 0:
        return mi.Float(0.0)
    cosine, active = _above(film, si, wo, active)
    m = dr.normalize(si.wi + wo)
    facets = _facets(film)
    return dr.select(active, facets.eval(m) * facets.smith_g1(si.wi, m) / (4 * cosine), 0)


def _eval_pdf(film: Any, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
    if film.alpha == 0:
        return dr.zeros(mi.UnpolarizedSpectrum), mi.Float(0.0)
    cosine, active = _above(film, si, wo, active)
    m = dr.normalize(si.wi + wo)
    facets = _facets(film)
    density = facets.eval(m) / (4 * cosine)
    shadowed, masked = facets.smith_g1(wo, m), facets.smith_g1(si.wi, m)
    colour = _reflectance(film, si, dr.dot(si.wi, m), active)
    value = colour * (density * shadowed * masked)
    return value & active, dr.select(active, density * masked, 0)


def _above(film: Any, si: Any, wo: Any, active: Any) -> Any:
    cosine = mi.Frame3f.cos_theta(si.wi)
    return cosine, active & (cosine > 0) & (mi.Frame3f.cos_theta(wo) > 0)


def _traverse(film: Any, callback: Any) -> None:
    if not isinstance(film.thickness, float):
        callback.put("thickness", film.thickness, mi.ParamFlags.Differentiable)


def _to_string(film: Any) -> str:
    return f"{NAME}[alpha = {film.alpha:g}]"


def _film() -> Any:
    """The class of the BSDF, made for the current variant."""

    class PellicleFilm(mi.BSDF):
        __init__ = _init
        sample = _sample
        eval = _eval
        pdf = _pdf
        eval_pdf = _eval_pdf
        traverse = _traverse
        to_string = _to_string

    return PellicleFilm
