"""`pellicle materials`: the catalogue, one material, and names that are none."""


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


def test_a_figure_needs_a_name(pellicle, tmp_path):
    assert pellicle("materials", "--out", tmp_path / "all.png").code == 2
    assert not (tmp_path / "all.png").exists()
