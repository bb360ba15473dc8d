"""NetCDF file of a posterior, as ArviZ's InferenceData."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pellicle.files import replacing
from pellicle.reporting.json_record import one_line, posterior_to_json

if TYPE_CHECKING:
    from arviz import InferenceData

    from pellicle.sampling.predict import Prediction
    from pellicle.sampling.result import Posterior


def write_netcdf(
    path: str | os.PathLike[str],
    posterior: Posterior,
    predictions: tuple[Prediction, ...],
    *,
    overwrite: bool = False,
) -> Path:
    """Write a posterior as NetCDF: draws in the parameters' units, one chain for each walker.

    Groups: posterior, sample_stats (lp), posterior_predictive (repeated measurements), observed_data. An
    untrusted chain is written too, with its attribute `trusted` 0. Raises UsageError where the file exists,
    without `overwrite`, or cannot be written.
    """
    target = Path(path)
    data = inference_data(posterior, predictions)
    with replacing(target, overwrite=overwrite) as draft:
        data.to_netcdf(str(draft), engine="h5netcdf")
    return target


def inference_data(posterior: Posterior, predictions: tuple[Prediction, ...]) -> InferenceData:
    """Convert a posterior and its predictions to ArviZ's InferenceData."""
    from pellicle.sampling.checks import arviz

    by_walker = np.moveaxis(posterior.draws, 0, 1)
    return arviz().from_dict(
        posterior={name: by_walker[:, :, i] for i, name in enumerate(posterior.names)},
        sample_stats={"lp": posterior.log_density.T},
        posterior_predictive={p.name: p.noisy[None] for p in predictions},
        observed_data={p.name: p.data for p in predictions},
        coords={p.axis.name: p.axis.values for p in predictions},
        dims={p.name: [p.axis.name] for p in predictions},
        attrs={
            "inference_library": "pellicle",
            "trusted": int(posterior.trusted),
            "doubts": "; ".join(posterior.checks.doubts),
            "record": one_line(posterior_to_json(posterior)),
        },
    )
