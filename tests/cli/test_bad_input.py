"""Every bad input: one sentence with what and where and how to mend it, the right code, no trace."""

import pytest

from pellicle.cli.session import say


@pytest.fixture
def refused(pellicle, tmp_path):
    """Runs a command that must fail: exactly one line of complaint, no result, nothing written."""

    def run(*arguments, code: int, said: tuple[str, ...]):
        before = sorted(tmp_path.rglob("*"))
        ran = pellicle(*arguments, "--out", tmp_path / "out")
        assert ran.code == code, ran.err
        assert ran.out == ""
        complaints = [line for line in ran.err.splitlines() if line.startswith("pellicle: ")]
        assert len(complaints) == 1, ran.err
        for words in said:
            assert words in complaints[0]
        assert "Traceback" not in ran.err
        assert [p for p in sorted(tmp_path.rglob("*")) if p != tmp_path / "out"] == before
        assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())

    return run


ROWS = "".join(f"{400 + 10 * i},0.{20 + i}\n" for i in range(10))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        pytest.param("", ("is empty",), id="empty"),
        pytest.param("wavelength,R\n" + ROWS + "500,blue\n", ("line 12", "'blue'"), id="text in a column"),
        pytest.param("wavelength,R\n" + ROWS + "500,nan\n", ("line 12", "nan"), id="NaN"),
        pytest.param("wavelength,R\n" + ROWS + "450,0.3\n", ("line 12", "450"), id="not monotone"),
        pytest.param(
            "wavelength,R\n" + ROWS + "500,31.5\n", ("line 12", "--signal-unit percent"), id="percent"
        ),
        pytest.param(
            "wavelength,R\n" + ROWS + "500,-0.3\n", ("line 12", "-0.3", "below zero"), id="negative"
        ),
        pytest.param("wavelength,R\n" + ROWS + "500,1.7\n", ("line 12", "1.7", "1.5"), id="above 1.5"),
    ],
)
def test_data(refused, tmp_path, scene, text, said):
    file = tmp_path / "film.csv"
    file.write_text(text)
    refused("fit", file, *scene, code=3, said=(str(file), *said))


def test_missing_file_and_folder(refused, tmp_path, scene):
    refused("fit", tmp_path / "gone.csv", *scene, code=3, said=("gone.csv", "no such file"))
    folder = tmp_path / "folder"
    folder.mkdir()
    refused("fit", folder, *scene, code=3, said=(str(folder), "is a folder"))


def test_outside_a_materials_table(refused, spectrum_file):
    file = spectrum_file()
    text = file.read_text().replace("400,", "200,").replace("404,", "201,")
    file.write_text(text)
    flags = ("--layer", "HfO2", "--substrate", "3.9", "--thickness", "10:800")
    refused("fit", file, *flags, code=3, said=(str(file), "HfO2", "250 to 900 nm", "--range"))


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--thickness", "800:10"), ("--thickness", "reversed")),
        (("--thickness", "-10:800"), ("--thickness", "negative")),
        (("--thickness", "-5"), ("--thickness", "negative")),
        (("--thickness", "thick"), ("--thickness", "number", "'thick'")),
        (("--thickness", "300"), ("nothing is free",)),
        (("--range", "700:400"), ("--range", "reversed")),
        (("--angle", "95"), ("--angle", "95")),
        (("--polarisation", "q"), ("--polarisation", "'q'")),
        (("--signal", "X"), ("--signal", "'X'")),
        (("--scale", "loose"), ("--scale", "'loose'")),
        (("--noise", "-1"), ("--noise",)),
        (("--free", "q"), ("--free q",)),
        (("--free", "k=-1:1"), ("--free k", "negative")),
        (("--plate-mm", "1"), ("--plate-mm", "--back")),
        (("--wavelength-unit", "inch"), ("--wavelength-unit", "'inch'", "um")),
        (("--signal-unit", "dB"), ("--signal-unit", "'dB'", "percent")),
        (("--dark", "dark.csv"), ("--dark", "--reference")),
    ],
    ids=lambda value: " ".join(value),
)
def test_flags(refused, spectrum_file, flags, said):
    base = {"--layer": "1.46", "--substrate": "3.9", "--thickness": "10:800"}
    given = base | {flags[0]: flags[1]}
    refused("fit", spectrum_file(), *(x for pair in given.items() for x in pair), code=2, said=said)


def test_missing_layer_substrate_and_data(refused, spectrum_file):
    refused("fit", spectrum_file(), "--substrate", "Si", code=2, said=("--layer is missing",))
    refused("fit", spectrum_file(), "--layer", "SiO2", code=2, said=("--substrate is missing",))
    refused("fit", code=2, said=("no data",))


@pytest.mark.parametrize("layer", ["SiO3", "hematit", "Unobtainium"])
def test_unknown_material_suggests_the_nearest(refused, spectrum_file, layer):
    nearest = {"SiO3": "SiO2", "hematit": "hematite"}.get(layer, "pellicle materials")
    refused("fit", spectrum_file(), "--layer", layer, "--substrate", "Si", code=2, said=(layer, nearest))


def test_an_intensity_without_a_scale(refused, tmp_path, scene):
    file = tmp_path / "counts.csv"
    file.write_text("wavelength,intensity\n" + ROWS)
    said = (str(file), "--scale slow")
    refused("fit", file, *scene, "--signal", "R", code=3, said=said)


@pytest.mark.parametrize(
    ("recipe", "said"),
    [
        ("[data]\nfile = ['a.csv']\n[scene]\nsubstrate = 'Si'\nlayer = []\n", ("data.file", "'files'")),
        ("[scene\n", ("is not TOML", "line 1")),
        ("[scene]\nsubstrat = 'Si'\n", ("scene.substrat", "'substrate'")),
        ("[scene]\nsubstrate = 'Si'\n", ("scene.layer is missing",)),
        (
            "[scene]\nsubstrate = 'Si'\n[[scene.layer]]\nmaterial = 'SiO2'\nthickness = 'thick'\n",
            ("thickness",),
        ),
        (
            "[scene]\nsubstrate = 'Si'\n[[scene.layer]]\nmaterial = 'SiO2'\n"
            "thickness = { lower = 30, upper = 10 }\n",
            ("thickness", "reversed"),
        ),
        (
            "[scene]\nsubstrate = 'Si'\n[[scene.layer]]\nmaterial = 'SiO3'\nthickness = 10\n",
            ("SiO3", "SiO2"),
        ),
    ],
)
def test_recipes(refused, tmp_path, recipe, said):
    path = tmp_path / "film.toml"
    path.write_text(recipe)
    refused("fit", "a.csv", "--recipe", path, code=3, said=(str(path), *said))


def test_a_missing_recipe(refused, tmp_path):
    refused("fit", "--recipe", tmp_path / "gone.toml", code=3, said=("gone.toml",))


def test_joint_fits_say_that_they_are_not_there(refused, tmp_path):
    path = tmp_path / "film.toml"
    path.write_text(
        "[data]\njoint = true\n[scene]\nsubstrate = 'Si'\n[[scene.layer]]\nmaterial = 'SiO2'\n"
        "thickness = { lower = 1, upper = 10 }\n"
    )
    refused("fit", "a.csv", "--recipe", path, code=2, said=("joint",))


def test_unknown_flags_and_commands_are_2(pellicle, spectrum_file, scene):
    for arguments in (
        ("fit", spectrum_file(), *scene, "--tickness", "3"),
        ("fit", spectrum_file(), *scene, "--plate-mm", "thin"),
        ("fitt",),
        ("simulate",),
    ):
        ran = pellicle(*arguments)
        assert ran.code == 2, arguments
        assert ran.out + ran.err
        assert "Traceback" not in ran.out + ran.err


def test_talk_goes_to_stderr(capsys):
    say("one", "two")
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "one\ntwo\n")
