"""`pellicle fit` and `pellicle sample`: fits of spectra, colours and BRDF samples, and their posteriors."""

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.batch import Batch, Sampler
from pellicle.cli.flags import (
    SAMPLER,
    SCENE,
    BatchFlags,
    FileFlags,
    FitFlags,
    Flags,
    SceneFlags,
    flag,
    switch,
)
from pellicle.cli.inputs import inputs
from pellicle.cli.session import start
from pellicle.errors import UsageError

FEWEST_STEPS = 10


@dataclass(frozen=True)
class SamplerFlags(Flags):
    """Flags of the sampling of a posterior."""

    walkers: Annotated[
        int | None, flag(SAMPLER, "Number of walkers, even (four per parameter, at least 32).")
    ] = None
    steps: Annotated[int | None, flag(SAMPLER, "Maximum number of steps (20000).")] = None
    seed: Annotated[int, flag(SAMPLER, "Seed of the random numbers.")] = 0

    def sampler(self) -> Sampler:
        """Settings of the sampler. Raises UsageError for an impossible number."""
        if self.steps is not None and self.steps < FEWEST_STEPS:
            raise UsageError(f"--steps must be at least {FEWEST_STEPS}, got {self.steps}")
        if not 0 <= self.seed < 2**32:
            raise UsageError(f"--seed must lie in 0 to 4294967295, got {self.seed}")
        return Sampler(self.walkers, self.steps, self.seed)


def fit(
    *data: Annotated[str, Parameter(help="Files to fit, one by one.")],
    recipe: Annotated[str | None, flag(SCENE, "TOML file that describes the scene or surface.")] = None,
    scene: Annotated[SceneFlags | None, Parameter(name="*")] = None,
    reading: Annotated[FileFlags | None, Parameter(name="*")] = None,
    fitting: Annotated[FitFlags | None, Parameter(name="*")] = None,
    joint: Annotated[bool, switch(SCENE, "Fit all files together: they are of one sample.")] = False,
    repeats: Annotated[
        bool, switch(SCENE, "Compare all files: they are repeated measurements of one spot.")
    ] = False,
    posterior: Annotated[bool, switch(SAMPLER, "Sample the posterior too, as pellicle sample does.")] = False,
    results: Annotated[BatchFlags | None, Parameter(name="*")] = None,
) -> int:
    """Fit a layer to measured reflectance, transmittance, ellipsometry, colours or BRDF samples.

    Example: pellicle fit oxide.csv --layer SiO2 --substrate Si --thickness 10:3000
    """
    results = (results or BatchFlags()).checked()
    files = inputs(list(data), recipe, scene, reading, fitting, joint, repeats)
    start()
    return Batch(files, Sampler() if posterior else None, **vars(results)).run()


def sample(
    *data: Annotated[str, Parameter(help="Files to fit and sample, one by one.")],
    recipe: Annotated[str | None, flag(SCENE, "TOML file that describes the scene or surface.")] = None,
    scene: Annotated[SceneFlags | None, Parameter(name="*")] = None,
    reading: Annotated[FileFlags | None, Parameter(name="*")] = None,
    fitting: Annotated[FitFlags | None, Parameter(name="*")] = None,
    joint: Annotated[bool, switch(SCENE, "One posterior for all files: they are of one sample.")] = False,
    chain: Annotated[SamplerFlags | None, Parameter(name="*")] = None,
    results: Annotated[BatchFlags | None, Parameter(name="*")] = None,
) -> int:
    """Fit, then sample the posterior of every free parameter, starting from every minimum that matters.

    Example: pellicle sample oxide.csv --layer SiO2 --substrate Si --free n --out results/oxide
    """
    results = (results or BatchFlags()).checked()
    sampler = (chain or SamplerFlags()).sampler()
    files = inputs(list(data), recipe, scene, reading, fitting, joint, False)
    start()
    return Batch(files, sampler, **vars(results)).run()
