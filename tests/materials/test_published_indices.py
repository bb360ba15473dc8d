"""Each page added for its name against a value that others published.

A value of the same page would prove nothing: where no handbook has one, it is another author's measurement of
the material, and the tolerance is then what such measurements differ by.
"""

import csv
from pathlib import Path

import pytest

from pellicle.materials import material

ROWS = Path(__file__).with_name("published_indices.csv").read_text("utf-8").splitlines()
PUBLISHED = list(csv.DictReader(row for row in ROWS if not row.startswith("#")))


@pytest.mark.parametrize("row", PUBLISHED, ids=[row["page"] for row in PUBLISHED])
def test_an_index_agrees_with_a_published_one(row):
    nm, n, k, tolerance = (float(row[name]) for name in ("wavelength_nm", "n", "k", "tolerance"))
    assert abs(complex(material(row["page"])(nm)) - complex(n, k)) < tolerance, row["source"]


def test_galena_reflects_as_the_mineral():
    """42.1 % at 589 nm in air: Criddle and Stanley, Quantitative Data File for Ore Minerals."""
    n = complex(material("PbS")(589.0))
    assert abs((n - 1) / (n + 1)) ** 2 == pytest.approx(0.421, abs=0.015)
