"""`pellicle read` and `pellicle materials`: content of files of measurements, and of n and k."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pellicle.api.data_files import check_camera, check_words, is_of_colours, read_films, refuse_camera
from pellicle.api.data_files import read as read_file
from pellicle.cli.flags import OUTPUT, CubeOnlyFlags, FileFlags, flag, switch
from pellicle.cli.messages import as_flags, say, show
from pellicle.cli.session import BAD_DATA, GOOD, error_message, reported, start
from pellicle.data.options import Family, FileOptions, named
from pellicle.errors import UsageError

if TYPE_CHECKING:
    from pellicle.data.brdf_samples import BrdfSamples
    from pellicle.data.colours import Colours
    from pellicle.data.cube import Cube
    from pellicle.data.spectrum import Spectrum

SUFFIXES = {"csv": ".csv", "netcdf": ".nc", "nexus": ".nxs"}


def read(
    *data: Annotated[str, Parameter(help="Files of measurements, or cubes of spectra.")],
    reading: Annotated[FileFlags | None, Parameter(name="*")] = None,
    cubes: Annotated[CubeOnlyFlags | None, Parameter(name="*")] = None,
    out: Annotated[
        str | None, flag(OUTPUT, "Folder for the spectra and their figures; existing files stay.")
    ] = None,
    to: Annotated[
        str, flag(OUTPUT, "Format of the spectra: csv, netcdf or nexus, or several (csv,nexus).")
    ] = "csv",
    json: Annotated[bool, switch(OUTPUT, "Print one JSON object per spectrum.")] = False,
) -> int:
    """Show what is understood of spectra, photographs, cubes and BRDF files, and convert spectra.

    Example: pellicle read wafer.txt --out converted --to csv,nexus

    Example: pellicle read photo.png --region 120,80,40,40

    Example: pellicle read stack.tif --wavelengths 400:900:5 --white-frame white.tif
    """
    options = (reading or FileFlags()).options()
    if not data:
        raise UsageError("no data: name the files, as in pellicle read oxide.csv")
    check_words(options)
    check_camera(options, [(path, options) for path in data])
    formats = [word.strip() for word in to.split(",")]
    if unknown := [word for word in formats if word not in SUFFIXES]:
        raise UsageError(f"--to must be of {', '.join(SUFFIXES)}, not {unknown[0]!r}")
    if options.reference or options.reference_material:
        start()  # the reflectance of the reference is computed
    from pellicle.reporting.json_record import error_record
    from pellicle.reporting.measured_text import describe, to_json

    worst, measurements = GOOD, []
    for path in data:
        try:
            measurements += _measurements(path, options, cubes or CubeOnlyFlags())
        except ValueError as error:
            message = error_message(error, [path])
            worst = reported(message, error_record(message, BAD_DATA) if json else None)
    if out is not None:
        from pellicle.data.brdf_samples import BrdfSamples
        from pellicle.data.cube import Cube

        if any(isinstance(one, Cube | BrdfSamples) for one in measurements):
            raise UsageError("--out writes spectra; a cube or a BRDF stays in its file: leave --out out")
    for one in measurements:
        show(to_json(one) if json else describe(one, tuple(map(as_flags, one.notes))))
    if out is not None:
        _write(Path(out), measurements, formats)
    return worst


def _measurements(
    path: str, options: FileOptions, of_cube: CubeOnlyFlags
) -> list[Spectrum] | list[Colours] | list[Cube] | list[BrdfSamples]:
    """Every spectrum of a file, the colours of every film in it, its cube, or its samples of a BRDF."""
    from pellicle.data.cubes.xarray_cubes import is_netcdf
    from pellicle.data.read_cube import is_cube

    if of_cube.given() or is_cube(Path(path)) or Path(path).is_dir():
        return [_cube(path, options, of_cube)]
    if is_of_colours(path, options):
        return read_films(path, options, angle=options.angle)
    refuse_camera(path, options)
    try:
        return _spectra(path, options)
    except ValueError as error:
        if not options.given() and (samples := _samples(path, error)) is not None:
            return [samples]
        if isinstance(error, UsageError) or not is_netcdf(Path(path)):
            raise
        try:  # a NetCDF file that is no spectrum may be a cube
            return [_cube(path, options, of_cube)]
        except ValueError as reason:
            if "no axis" not in str(reason):
                raise reason from None
        raise


def _samples(path: str, error: ValueError) -> BrdfSamples | None:
    """The samples of a BRDF in a file that by this `error` is no spectrum; None if it is not of a BRDF."""
    from pellicle.data.formats.merl import is_merl
    from pellicle.data.read_brdf import read_brdf_samples
    from pellicle.data.tabular.text import read_bytes

    try:
        return read_brdf_samples(path)
    except ValueError:  # the fault of a file of a BRDF is what to mend, not that it is no spectrum
        if "of a BRDF" in str(error) or is_merl(path) or b"#PARAM_IN" in read_bytes(path)[0]:
            raise
        return None


def _cube(path: str, options: FileOptions, of_cube: CubeOnlyFlags) -> Cube:
    """The cube of a file; flags of other files are refused."""
    from pellicle.cli.flags import CubeFlags
    from pellicle.data.read_cube import read_cube

    shared = options.given()
    known = {field.name for field in fields(CubeFlags)}
    if wrong := sorted(set(shared) - known):
        raise UsageError(
            f"{path}: is a cube of spectra, which {named(wrong[:1])[0]} does not apply to: leave it out"
        )
    return read_cube(path, **CubeFlags(**{**vars(of_cube), **shared}).arguments())


def _spectra(path: str, options: FileOptions) -> list[Spectrum]:
    """Every spectrum of a file, unless one is chosen, with the angle of the flag where the file has none."""
    from dataclasses import replace

    import numpy as np

    every = replace(options, spectrum=options.spectrum or "all")
    spectra = read_file(path, every)
    if options.angle is None:
        return spectra
    if isinstance(options.angle, list):
        raise UsageError(f"{path}: --angle lists several: of spectra give one, or a column angle_deg")
    stated = [one.source for one in spectra if one.angle is not None and np.any(one.angle != options.angle)]
    if stated:
        raise UsageError(f"{stated[0]}: states its own angles; leave --angle out")
    return [replace(one, angle=np.full(len(one), float(options.angle))) for one in spectra]


def _write(folder: Path, measurements: list[Any], formats: list[str]) -> None:
    from pellicle.data.colours import Colours, write_colours
    from pellicle.data.write_spectrum import write_spectrum
    from pellicle.reporting.figures import draw_spectrum as draw
    from pellicle.reporting.folders import distinct_stems
    from pellicle.reporting.matplotlib_figure import save_figure

    if formats != ["csv"] and any(isinstance(one, Colours) for one in measurements):
        raise UsageError(f"--to {','.join(formats)}: colours are written as csv; leave it out")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"--out {folder}: cannot be made ({error.strerror}); choose another folder"
        ) from None
    labels = [f"{one.path} [{one.name}]" if one.name else one.path for one in measurements]
    for one, stem in zip(measurements, distinct_stems(labels), strict=True):
        if isinstance(one, Colours):
            written = [write_colours(folder / f"{stem}.csv", [one])]
        else:
            written = [write_spectrum(folder / f"{stem}{SUFFIXES[word]}", one) for word in formats]
            written.append(save_figure(draw(one), folder / f"{stem}.png"))
        say(f"{folder}: {', '.join(path.name for path in written)} written")


def materials(
    name: Annotated[str | None, Parameter(help="Name of a material, or a file of n and k.")] = None,
    *,
    family: Annotated[Family | None, Parameter(help="List the materials of one family.")] = None,
    out: Annotated[str | None, Parameter(help="File for the figure of n and k (PNG, PDF, SVG).")] = None,
    json: Annotated[bool, switch(OUTPUT, "Print the list as one JSON object.")] = False,
) -> int:
    """List the catalogue, or describe one material or its file, and draw its n and k.

    Of a file it says what is understood: format, columns, unit and range.

    Example: pellicle materials Au --out gold.png

    Example: pellicle materials --family sulfide
    """
    from pellicle.materials import UnknownMaterial
    from pellicle.reporting import materials as catalogue

    if name is None:
        if out is not None:
            raise UsageError("--out draws one material: name it, as in pellicle materials Au --out gold.png")
        if json:
            show(catalogue.to_json(family))
        else:
            print(catalogue.table(family), end="")
        return 0
    if family is not None or json:
        raise UsageError("--family and --json are of the list: leave the name out")
    try:
        print(catalogue.describe(name), end="")
    except UnknownMaterial as error:
        raise UsageError(str(error)) from None
    if out is not None:
        catalogue.figure(name, out)
        say(f"{out}: figure written")
    return 0
