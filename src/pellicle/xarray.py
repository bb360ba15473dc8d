"""Accessor `pellicle` of xarray's DataArray and Dataset: `import pellicle.xarray` registers it."""

from typing import Any, final

import numpy as np

from pellicle.api.fits import fit
from pellicle.api.maps import map, series
from pellicle.data.read_cube import read_cube
from pellicle.data.spectrum import Spectrum
from pellicle.errors import UsageError, needs
from pellicle.fitting.result import Fit
from pellicle.scene.film import Scene

with needs("maps", "the accessor of xarray needs"):
    import xarray


@xarray.register_dataset_accessor("pellicle")
@xarray.register_dataarray_accessor("pellicle")
@final
class Accessor:
    """Spectra in an xarray object, with axes as `pellicle.read_cube` recognises them.

    ```python
    import pellicle.xarray

    cube = xarray.open_dataset("wafer.nc")
    cube.isel(y=7, x=30).pellicle.fit(scene)
    cube.pellicle.map(scene, noise=0.005)
    ```
    """

    def __init__(self, data: Any):
        self._data = data

    def map(self, scene: Scene, **options: Any) -> Any:
        """Fit every pixel, as `pellicle.map`."""
        return map(self._data, scene, **options)

    def series(self, scene: Scene, **options: Any) -> Any:
        """Fit all times together, as `pellicle.series`."""
        return series(self._data, scene, **options)

    def spectrum(self, **reading: Any) -> Spectrum:
        """The one spectrum of an object without pixels. `reading`: arguments of `pellicle.read_cube`.

        Points that are not finite are left out. Raises UsageError for more than one spectrum.
        """
        cube = read_cube(self._data.expand_dims("site"), **reading)
        if cube.dims != ("site",):
            several = ", ".join(dim for dim in cube.dims if dim != "site")
            raise UsageError(f"there are spectra along {several}: select one with isel or sel, or map all")
        columns = {name: values[0] for name, values in cube.pixels((slice(None),)).items()}
        angles = np.zeros(1) if cube.angle is None else cube.angle
        nm, angle = (np.ravel(x) for x in np.meshgrid(cube.wavelength, angles, indexing="ij"))
        if cube.angle is not None:
            columns["angle"] = angle
        kept = np.all([np.isfinite(values) for values in columns.values()], axis=0)
        columns = {name: values[kept] for name, values in columns.items()}
        about: dict[str, Any] = {"polarisation": cube.polarisation, "calibrated": cube.calibrated}
        return Spectrum(nm[kept], signal=cube.signal, notes=cube.notes, **columns, **about)

    def fit(self, scene: Scene, **reading: Any) -> Fit:
        """Fit the one spectrum, as `pellicle.fit`. `reading` as of `spectrum`."""
        return fit(self.spectrum(**reading), scene)
