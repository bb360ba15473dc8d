"""Write src/pellicle/materials/data/pages.csv: one line per included page, faster to read than the pages.

Run after adding a page: python scripts/index_materials.py
"""

import csv
import re
from pathlib import Path

from pellicle.materials.formats.refractiveindex_info import contents, csv_contents, load_yaml, plain_text

DATA = Path(__file__).parents[1] / "src/pellicle/materials/data"
SHELVES = ("glass", "main", "organic", "other", "popular_glass", "specs")
BOOKS_OF_SEVERAL_WORDS = (
    "Microchem_SU8_3000",
    "poly_methyl_methacrylate",
    "polyethylene_terephthalate",
    "polyvinyl_alcohol",
    "polyvinyl_chloride",
    "stainless_steel",
)
SOPRA = {
    "CU2O": "Cu2O",
    "CUO": "CuO",
    "HFO2": "HfO2",
    "ITO2": "In2O3-SnO2",
    "MO": "Mo",
    "PBS": "PbS",
    "SIO": "SiO",
    "TA": "Ta",
    "TIO2": "TiO2",
    "TIO2B": "TiO2",
    "Y2O3": "Y2O3",
}
SOPRA_CITATION = "SOPRA n,k database, SOPRA S.A., Bois-Colombes (tables as carried by solcore 5.10.1)"
MODEL_CITATION = (
    "Model, not measured (scripts/make_hgs_model.py): Tauc-Lorentz band, G. E. Jellison and F. A. Modine, "
    "Appl. Phys. Lett. 69, 371 (1996), with the index above 620 nm of W. L. Bond et al., "
    "J. Appl. Phys. 38, 4090 (1967)"
)
_INITIALS = re.compile(r"^(?:\S{1,3}\.[\s-]*)+")
_END_OF_NAMES = re.compile(r"(?<=\w{3})\.(?:\s|$)")


def short_citation(markup: str | None) -> str:
    """First author and year ("Johnson et al. 1972"), parsed from the text of the reference."""
    lines = [text for text in map(plain_text, (markup or "").splitlines()) if text]
    if not lines:
        return ""
    names = _END_OF_NAMES.split(re.sub(r"^\d\)\s*|\s*\(.*|\.$", "", lines[0]))[0]
    authors = [name for name in re.split(r"\s*,\s*|\s+and\s+", names) if re.search(r"[^\W\d_]{2}", name)]
    surname = _INITIALS.sub("", authors[0]) if authors else names[:30]
    shared = " et al." if len(authors) > 1 else ""
    text = " ".join(lines)
    year = re.search(r"\((1[89]\d\d|20\d\d)\)", text) or re.search(r"\b(1[89]\d\d|20\d\d)\b", text)
    return f"{surname}{shared}{' ' + year.group(1) if year and year.group(1) not in surname else ''}"


def database_rows():
    for file in sorted((DATA / "refractiveindex.info").glob("*.yml")):
        shelf = next(s for s in SHELVES if file.stem.startswith(s + "_"))
        name = file.stem.removeprefix(shelf + "_")
        several = next((b for b in BOOKS_OF_SEVERAL_WORDS if name.startswith(b + "_")), None)
        book = several or name.split("_", 1)[0]
        page = name.removeprefix(book + "_")
        content = load_yaml(file.read_text(encoding="utf-8"))
        page_contents = contents(content)
        references = content["REFERENCES"]
        yield {
            "shelf": shelf,
            "book": book,
            "page": page,
            "file": file.relative_to(DATA).as_posix(),
            "low": f"{page_contents.wavelength_range[0]:.10g}",
            "high": f"{page_contents.wavelength_range[1]:.10g}",
            "has_extinction": "yes" if page_contents.has_extinction else "no",
            "short": short_citation(references),
            "citation": plain_text(references),
            "comments": plain_text(content.get("COMMENTS")),
        }


def table_row(file, shelf, book, page, short, citation, comments):
    page_contents = csv_contents(file.read_text(encoding="utf-8"))
    return {
        "shelf": shelf,
        "book": book,
        "page": page,
        "file": file.relative_to(DATA).as_posix(),
        "low": f"{page_contents.wavelength_range[0]:.10g}",
        "high": f"{page_contents.wavelength_range[1]:.10g}",
        "has_extinction": "yes",
        "short": short,
        "citation": citation,
        "comments": comments,
    }


def table_rows():
    yield table_row(
        DATA / "model/HgS.csv", "model", "HgS", "edge", "model, not measured", MODEL_CITATION, "Cinnabar."
    )
    for page, book in SOPRA.items():
        file = DATA / "sopra" / f"{page}.csv"
        yield table_row(file, "sopra", book, page, "SOPRA", SOPRA_CITATION, f"SOPRA's material {page}.")


def main():
    rows = sorted([*database_rows(), *table_rows()], key=lambda r: (r["shelf"], r["book"], r["page"]))
    with (DATA / "pages.csv").open("w", encoding="utf-8", newline="") as target:
        writer = csv.DictWriter(target, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
