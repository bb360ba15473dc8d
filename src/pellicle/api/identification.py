"""Verb of identification: which film is on a substrate."""

import time
from collections.abc import Sequence

import jax

from pellicle.data.measurement import check_measurement
from pellicle.data.options import CONDITIONS
from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError
from pellicle.identification import films
from pellicle.identification.hypothesis import Identification
from pellicle.identification.identify import identified
from pellicle.identification.request import Request
from pellicle.scene.film import Light
from pellicle.scene.free import is_free
from pellicle.scene.layers import MediumLike, Substrate, medium


def identify(
    data: Spectrum | Sequence[Spectrum],
    substrate: Substrate | MediumLike,
    *,
    ambient: MediumLike = 1.0,
    back: MediumLike | None = None,
    angle: float = 0.0,
    among: Sequence[str] | None = None,
    family: str | None = None,
    layers: int = 2,
    allow: Sequence[str] = CONDITIONS,
    budget: float | None = None,
) -> Identification:
    """Identify the film on a known substrate, in float64.

    Structures grow from the bare substrate over films of the catalogue, dispersion models, effects and second
    layers until one describes the data within noise and usual systematic effects. Their evidence, with these
    effects integrated out, decides which the data leave.

    **Arguments:**

    - `data`: a `Spectrum` of R, T, or Ψ and Δ, or a list of these, of one sample, which count jointly.
    - `substrate`: a `Substrate`, or its material. `back` is the medium behind it, where it is a plate.
    - `ambient`: the medium of the incident light.
    - `angle` of incidence in degrees, where the data have none.
    - `among`: names of materials to try; or `family`, "oxide", "nitride", "fluoride", "polymer",
      "semiconductor" or "metal". By default all of these.
    - `layers`: the largest number of layers beside a native oxide, 1 or 2.
    - `allow`: usual mistakes that are tried where nothing describes the data as stated: "calibration", a
      reflectance relative to another mirror, "plate", light from a back face, and "substrate", another glass.
      What they explain is never more than undecided.
    - `budget`: seconds after which no more structures are tried.

    **Returns:** `Identification`: a status, the hypotheses that are left with their probabilities, the
    excluded ones, and a verdict. `scene()` of a hypothesis is what `pellicle.fit` takes.

    **Raises:** UsageError for other signals, an unknown family, and Ψ and Δ without an angle; DataError for
    fewer than 20 points and a substrate without data at the wavelengths; ValueError for an unknown material.

    ```python
    >>> oxide = pl.Scene(pl.Layer("SiO2", 300.0), "Si")
    >>> found = pl.identify(pl.simulate(oxide, noise=0.002), "Si")
    >>> found.status.value, found.best.layers[0].like[0], round(found.best.layers[0].thickness.value, -1)
    ('identified', 'SiO2', 300.0)

    ```
    """
    began = time.perf_counter()
    check_measurement(data)
    spectra = [data] if isinstance(data, Spectrum) else list(data)
    if not spectra or not all(isinstance(x, Spectrum) for x in spectra):
        raise UsageError("`data` must be a spectrum, or a list of spectra of one sample")
    if layers not in (1, 2):
        raise UsageError(f"`layers` must be 1 or 2, not {layers!r}")
    if isinstance(allow, str):
        raise UsageError(f"`allow` must be a list, as in [{allow!r}]")
    if budget is not None and not budget > 0:
        raise UsageError(f"`budget` must be above 0 seconds, not {budget!r}")
    if unknown := [x for x in allow if x not in CONDITIONS]:
        raise UsageError(f"`allow` must be of {', '.join(CONDITIONS)}, not {unknown[0]!r}")
    below = substrate if isinstance(substrate, Substrate) else Substrate(substrate, back=back)
    request = Request(
        below, medium(ambient), Light(angle=angle), tuple(films.chosen(among, family)), layers, tuple(allow),
        float("inf") if budget is None else budget,
    )  # fmt: skip
    if any(map(is_free, jax.tree_util.tree_leaves(request.around(), is_leaf=is_free))):
        raise UsageError("`substrate`, `ambient`, `back` and `angle` must be known, without free numbers")
    with jax.enable_x64(True):
        return identified(spectra, request, began)
