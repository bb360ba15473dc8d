"""Report of an exported film: both sets of numbers, and how far a renderer is from the exact colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pellicle.reporting.plain_text import block, table, wrapped

if TYPE_CHECKING:
    from pellicle.rendering.export import Export


def text(export: Export) -> str:
    """Format an exported film as plain text."""
    material = export.material
    notes = [line for note in material.look.notes for line in wrapped(note, "- ", "  ")]
    if material.solved is None:
        return block(f"{export.title}: {material.name}", [*wrapped("exact colours, tabulated"), *notes])
    sets = {"as it is": material.solved.physical, "solved": material.solved.effective}
    rows = [("", *sets)]
    thickness = [x.scale * material.look.thickness for x in sets.values()]
    rows.append(("thickness (nm)", *(_span(nm) for nm in thickness)))
    rows += [
        (key, *(_number(each.numbers[key]) for each in sets.values()))
        for key in material.solved.physical.numbers
    ]
    rows.append(("mean ΔE2000", *(f"{each.error.mean:.2f}" for each in sets.values())))
    rows.append(("largest ΔE2000", *(f"{each.error.largest:.1f}" for each in sets.values())))
    used = "solved numbers are" if material.solved.used == "effective" else "film's own numbers are"
    said = wrapped(
        f"ΔE2000 of {material.solved.formula.name} from the exact colours (CIE 1931, D65), 0 to 80 degrees."
        f" The {used} drawn; the file has both."
    )
    return block(f"{export.title}: {material.name}", [*table(rows), "", *said, *notes])


def _span(nm: np.ndarray) -> str:
    return f"{nm[0]:.5g}" if len(nm) == 1 else f"{nm[0]:.5g} to {nm[-1]:.5g}"


def _number(value: Any) -> str:
    return " ".join(f"{x:.4g}" for x in np.ravel(value))
