"""`pellicle materials`: the catalogue of materials."""

from typing import Annotated

from cyclopts import Parameter

from pellicle.cli.session import say


def materials(
    name: Annotated[str | None, Parameter(help="Name of a material, or a file of n and k.")] = None,
    *,
    out: Annotated[str | None, Parameter(help="File for the figure of n and k (PNG, PDF, SVG).")] = None,
) -> int:
    """List the catalogue, or describe one material or its file, and draw its n and k.

    Of a file it says what is understood: format, columns, unit and range.

    Example: pellicle materials Au --out gold.png
    """
    from pellicle.errors import UsageError
    from pellicle.materials import UnknownMaterial
    from pellicle.reporting import materials as catalogue

    if name is None:
        if out is not None:
            raise UsageError("--out draws one material: name it, as in pellicle materials Au --out gold.png")
        print(catalogue.table(), end="")
        return 0
    try:
        print(catalogue.describe(name), end="")
    except UnknownMaterial as error:
        raise UsageError(str(error)) from None
    if out is not None:
        catalogue.figure(name, out)
        say(f"{out}: figure written")
    return 0
