"""Results of fits of many pixels: plain arrays with a row for each pixel."""

from typing import NamedTuple

import numpy as np

from pellicle.fitting.result import Status

NO_DATA, BY_NEIGHBOURS = "no-data", "by-neighbours"
STATUSES = (NO_DATA, *(str(status) for status in Status), BY_NEIGHBOURS)
"""Status words of a pixel, in the order of their codes: those of `pellicle.fit`, that of a pixel without
data, and that of one whose order of interference its neighbours decide."""
CODES = {word: code for code, word in enumerate(STATUSES)}


class PixelFits(NamedTuple):
    """Fits of pixels, arrays (pixels, ...) in the order of the problem's parameters.

    `values` and `stderr` (pixels, parameters) are in the parameters' own units; `stderr` is the combined
    standard uncertainty, as in `pellicle.fit`, infinite where the data do not determine the parameter, and
    `stderr_noise` that of the noise alone. `minima` (pixels, orders, parameters) are the best minima of each
    pixel, its answer first, and `delta_chi2` (pixels, orders) how much worse they are: infinite where there
    are no more. `status` (pixels,) are codes of `STATUSES`. Numbers of a pixel without data are NaN.
    """

    values: np.ndarray
    stderr: np.ndarray
    stderr_noise: np.ndarray
    status: np.ndarray
    minima: np.ndarray
    delta_chi2: np.ndarray
    chi2_reduced: np.ndarray
    rms: np.ndarray
