"""The registry of renderers: every target is named where users look, and says which package it lacks."""

import numpy as np
import pytest

import pellicle as pl
from pellicle.errors import UsageError
from pellicle.rendering import targets
from pellicle.rendering.appearance import appearance
from pellicle.rendering.formula import physical
from pellicle.rendering.targets import TARGETS, Target, target


@pytest.mark.parametrize("name", TARGETS)
def test_a_target_bears_its_name(name):
    found = target(name, package_check=False)
    assert found.name == name
    assert found.suffixes
    assert all(suffix.startswith(".") for suffix in found.suffixes)


def test_the_documentation_of_python_names_every_target():
    assert [name for name in TARGETS if f'"{name}"' not in (pl.export.__doc__ or "")] == []


def test_an_absent_package_is_named_with_its_extra(monkeypatch, refuses):
    monkeypatch.setattr(targets, "find_spec", lambda name: None)
    refuses(UsageError, r"pygltflib: pip install .pellicle\[render\]", target, "gltf")


def test_tables_lack_nothing_that_formulas_lack(tmp_path, monkeypatch):
    """Exact colours have the layers and the extinction of which formulas have none."""

    def write(path, material):
        path.write_text("")
        return (path,)

    made = Target("table", "Table", (".table",), (), None, write)
    monkeypatch.setattr("pellicle.rendering.export.target", lambda name: made)
    stack = pl.Scene([pl.Layer(1.46, 50.0), pl.Layer(2.9 + 0.1j, 20.0, name="low")], 3.9)
    written = pl.export(stack, to="table", path=tmp_path / "a.table", layer="low")
    assert written.material.look.notes == ()
    lacking = [note.split(":")[0] for note in written.material.look.lacking]
    assert lacking == ["the film has 2 layers", "the layer absorbs"]
    assert "formats have one, here low of 20 nm" in written.material.look.lacking[0]


def test_gold_has_the_least_index_of_formats_and_titania_absorbs_nothing():
    gold, titania = (appearance(pl.Scene(pl.Layer(name, 20.0), "BK7")) for name in ("Au", "TiO2"))
    assert gold.index == 1
    assert [look.lacking for look in (gold, titania)] == [
        ("the layer absorbs: formats have none that does",),
        (),
    ]
    for name in TARGETS:
        formula = target(name, package_check=False).formula
        if formula is not None:
            assert np.isfinite(physical(formula(gold), gold).error.mean)
