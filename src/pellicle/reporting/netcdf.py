"""NetCDF file of a posterior, as ArviZ's InferenceData."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pellicle.files import check_space, replacing
from pellicle.reporting.json_record import one_line, posterior_to_json, to_json

if TYPE_CHECKING:
    from arviz import InferenceData

    from pellicle.sampling.predict import Prediction
    from pellicle.sampling.result import Posterior

_OVERHEAD = 1.1, 2**19
"""Most of what HDF5 adds to the arrays: a share for chunks, and bytes for attributes and groups."""


def write_netcdf(
    path: str | os.PathLike[str],
    posterior: Posterior,
    predictions: tuple[Prediction, ...],
    *,
    overwrite: bool = False,
) -> Path:
    """Write a posterior as NetCDF: draws in the parameters' units, one chain for each walker.

    Groups: posterior, sample_stats (lp), posterior_predictive (repeated measurements), observed_data. An
    untrusted chain is written too, with its attribute `trusted` 0. Other attributes: `data_path` and
    `data_sha256`, `scene`, `pellicle_version` and `date`, the JSON records of the `fit` and, as
    `record`, of the posterior. Raises UsageError where the file exists, without `overwrite`, or cannot be
    written, DataError for a full disk.
    """
    target = Path(path)
    data = inference_data(posterior, predictions)
    size = sum(data[group].nbytes for group in data.groups())
    with replacing(target, overwrite=overwrite) as draft:
        check_space(draft, int(_OVERHEAD[0] * size) + _OVERHEAD[1])  # HDF5 crashes where a disk is full
        data.to_netcdf(str(draft), engine="h5netcdf")
    return target


def inference_data(posterior: Posterior, predictions: tuple[Prediction, ...]) -> InferenceData:
    """Convert a posterior and its predictions to ArviZ's InferenceData."""
    from pellicle.sampling.checks import arviz

    by_walker = np.moveaxis(posterior.draws, 0, 1)
    fit = to_json(posterior.fit)
    data = fit["data"] if posterior.fit.joint else [fit["data"]]
    return arviz().from_dict(
        posterior={name: by_walker[:, :, i] for i, name in enumerate(posterior.names)},
        sample_stats={"lp": posterior.log_density.T},
        posterior_predictive={p.name: p.noisy[None] for p in predictions},
        observed_data={p.name: p.data for p in predictions},
        coords={p.axis.name: p.axis.values for p in predictions},
        dims={p.name: [p.axis.name] for p in predictions},
        attrs={
            "inference_library": "pellicle",
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "pellicle_version": fit["versions"]["pellicle"],
            "data_path": "; ".join(part["path"] for part in data),
            "data_sha256": "; ".join(part["sha256"] for part in data),
            "scene": str(posterior.fit.scene),
            "fit": one_line(fit),
            "trusted": int(posterior.trusted),
            "doubts": "; ".join(posterior.checks.doubts),
            "record": one_line(posterior_to_json(posterior)),
        },
    )
