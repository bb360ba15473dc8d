"""Sources to cite with a fit: the program, the materials that its scene names, models and methods."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING

from pellicle.materials.named_dispersion import materials_in

if TYPE_CHECKING:
    from pellicle.fitting.result import Fit
    from pellicle.sampling.result import Posterior

_GRANIER = "X. Granier and W. Heidrich: A simple layered RGB BRDF model. Pacific Graphics 2002."
_BELCOUR = (
    "L. Belcour and P. Barla: A practical extension to microfacet theory for the modeling of varying"
    " iridescence. ACM Transactions on Graphics 36 (4), 65 (2017), doi:10.1145/3072959.3073620."
)
_MODELS = {"granier-heidrich": _GRANIER, "microfacet-film": _BELCOUR}
"""Papers of BRDF models, by the beginning of the model's name."""
_EMCEE = (
    "D. Foreman-Mackey, D. W. Hogg, D. Lang and J. Goodman: emcee: the MCMC hammer."
    " Publications of the Astronomical Society of the Pacific 125, 306 (2013)."
)
_DATABASE = (
    "M. N. Polyanskiy: refractiveindex.info database of optical constants. Scientific Data 11, 94 (2024),"
    " doi:10.1038/s41597-023-02898-2."
)


def sources(fit: Fit, posterior: Posterior | None = None) -> list[str]:
    """Sources of a fit, pellicle first."""
    result = [f"The pellicle developers: pellicle {version('pellicle')}."]
    named = [material for material in materials_in(fit.scene) if material.citation]
    result += [f"{each.name} ({each.page}): {each.citation.rstrip('.')}." for each in named]
    if any(each.page.count("/") >= 2 for each in named):
        result.append(_DATABASE)
    if fit.layer_test is not None:
        result += [text for name, text in _MODELS.items() if fit.surface.model.startswith(name)]
    if posterior is not None:
        result.append(_EMCEE)
    return list(dict.fromkeys(result))


def bibtex() -> str:
    """BibTeX entry of this version of pellicle."""
    number = version("pellicle")
    return "\n".join(
        [
            "@software{pellicle,",
            "  author = {{The pellicle developers}},",
            "  title = {pellicle: thickness and refractive index of thin layers from measured spectra},",
            f"  version = {{{number}}},",
            "}",
        ]
    )
