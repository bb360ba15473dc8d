"""`pellicle materials`: the catalogue, one material, and names that are none."""

import json


def test_the_catalogue(pellicle):
    ran = pellicle("materials", code=0)
    for name in ("SiO2", "Au", "BK7", "Fe2O3"):
        assert name in ran.out
    assert ran.err == ""


def test_one_material_with_its_citation(pellicle, tmp_path):
    ran = pellicle("materials", "Au", code=0)
    assert "Johnson" in ran.out
    assert " nm" in ran.out
    figure = tmp_path / "gold.png"
    drawn = pellicle("materials", "Au", "--out", figure, code=0)
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert str(figure) in drawn.err


def test_an_unknown_name_suggests(pellicle):
    ran = pellicle("materials", "SiO3", code=2)
    assert ran.out == ""
    assert "SiO2" in ran.err


def test_an_unknown_name_says_what_else_may_stand_there(pellicle):
    ran = pellicle("materials", "NiFe2O4", code=2)
    assert "file of n and k" in ran.err
    assert "cauchy" in ran.err


def test_a_family(pellicle):
    names = [
        line.split()[0] for line in pellicle("materials", "--family", "sulfide", code=0).out.splitlines()
    ]
    assert {"CdS", "CdS/Treharne", "HgS/Bond-o", "MoS2", "PbS", "ZnS"} < {*names}
    assert not {"SiO2", "CdSe", "Au"} & {*names}


def test_a_family_as_json(pellicle):
    record = json.loads(pellicle("materials", "--family", "halide", "--json", code=0).out)
    assert record["schema"] == "pellicle.materials/1"
    by_name = {entry["name"]: entry for entry in record["materials"]}
    assert by_name["AgCl"]["range_nm"] == [578, 20600]
    assert by_name["AgCl"]["has_k"] is False
    assert "horn-silver" in by_name["AgCl"]["aliases"]
    assert all("halide" in entry["families"] for entry in record["materials"])


def test_a_family_is_one_of_the_list(pellicle):
    assert pellicle("materials", "--family", "sulphide").code == 2
    assert pellicle("materials", "Au", "--family", "metal").code == 2


def test_a_figure_needs_a_name(pellicle, tmp_path):
    assert pellicle("materials", "--out", tmp_path / "all.png").code == 2
    assert not (tmp_path / "all.png").exists()
