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

from __future__ import annotations

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


def _film() -> Any:
    """The class of the BSDF, made for the current variant."""

    class PellicleFilm(mi.BSDF):
        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            with np.load(str(mi.file_resolver().resolve(props["filename"]))) as table:
                self.span = [float(x) for x in table["thickness"]]
                own = float(table["default_thickness"])
                values = table["spectra" if mi.is_spectral else "rgb"]
                self.wavelength = [float(x) for x in table["wavelength"][[0, -1]]]
            self.shape = values.shape  # thicknesses, cosines, channels or wavelengths
            self.texture = table_texture(values[..., None] if mi.is_spectral else values)
            self.alpha = float(props.get("alpha", 0.1))
            self.low = float(props.get("thickness_min", 0.0))
            self.high = float(props.get("thickness_max", self.span[1]))
            self.thickness: Any = props.get("thickness", own)
            lobe = mi.BSDFFlags.GlossyReflection if self.alpha > 0 else mi.BSDFFlags.DeltaReflection
            varies = 0 if isinstance(self.thickness, float) else mi.BSDFFlags.SpatiallyVarying
            self.m_components = [lobe | mi.BSDFFlags.FrontSide | varies]
            self.m_flags = self.m_components[0]
            self.flag = lobe

        def reflectance(self, si: Any, cosine: Any, active: Any) -> Any:
            """Reflectance of the film at a cosine of the angle of incidence."""
            nm = self.thickness
            if not isinstance(nm, float):
                nm = self.low + (self.high - self.low) * nm.eval_1(si, active)
            across = node(cosine, self.shape[1])
            down = node((nm - self.span[0]) / (self.span[1] - self.span[0]), self.shape[0])
            if not mi.is_spectral:
                rgb = self.texture.eval(mi.Point2f(across, down), active)
                return mi.Color3f(rgb[0], rgb[1], rgb[2])
            first, last = self.wavelength
            found = dr.zeros(mi.UnpolarizedSpectrum)
            for channel in range(len(found)):
                share = (si.wavelengths[channel] - first) / (last - first)
                at = mi.Point3f(node(share, self.shape[2]), across, down)
                found[channel] = self.texture.eval(at, active)[0]
            return found

        def facets(self) -> Any:
            return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            bs = mi.BSDFSample3f()
            cosine = mi.Frame3f.cos_theta(si.wi)
            active = active & (cosine > 0)
            bs.eta = 1.0
            bs.sampled_component = mi.UInt32(0)
            bs.sampled_type = mi.UInt32(+self.flag)
            if self.alpha == 0:
                bs.wo = mi.reflect(si.wi)
                bs.pdf = mi.Float(1.0)
                return bs, self.reflectance(si, cosine, active) & active
            facets = self.facets()
            m, pdf = facets.sample(si.wi, sample2)
            bs.wo = mi.reflect(si.wi, m)
            active = active & (pdf > 0) & (mi.Frame3f.cos_theta(bs.wo) > 0)
            bs.pdf = pdf / (4 * dr.dot(bs.wo, m))
            weight = facets.smith_g1(bs.wo, m)
            return bs, (self.reflectance(si, dr.dot(si.wi, m), active) * weight) & active

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            if self.alpha == 0:
                return mi.Float(0.0)
            cosine, active = self._above(si, wo, active)
            m = dr.normalize(si.wi + wo)
            facets = self.facets()
            return dr.select(active, facets.eval(m) * facets.smith_g1(si.wi, m) / (4 * cosine), 0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            if self.alpha == 0:
                return dr.zeros(mi.UnpolarizedSpectrum), mi.Float(0.0)
            cosine, active = self._above(si, wo, active)
            m = dr.normalize(si.wi + wo)
            facets = self.facets()
            density = facets.eval(m) / (4 * cosine)
            shadowed, masked = facets.smith_g1(wo, m), facets.smith_g1(si.wi, m)
            colour = self.reflectance(si, dr.dot(si.wi, m), active)
            value = colour * (density * shadowed * masked)
            return value & active, dr.select(active, density * masked, 0)

        def _above(self, si: Any, wo: Any, active: Any) -> Any:
            cosine = mi.Frame3f.cos_theta(si.wi)
            return cosine, active & (cosine > 0) & (mi.Frame3f.cos_theta(wo) > 0)

        def traverse(self, callback: Any) -> None:
            if not isinstance(self.thickness, float):
                callback.put("thickness", self.thickness, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return f"{NAME}[alpha = {self.alpha:g}]"

    return PellicleFilm
