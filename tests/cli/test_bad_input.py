"""Every bad input: one sentence with what and where and how to mend it, the right code, no trace."""

import shlex

import pytest

ROWS = "".join(f"{400 + 10 * i},0.{20 + i}\n" for i in range(10))
FAR_ROWS = "".join(f"{nm},0.2\n" for nm in range(200, 240, 2))
"""More points than the others, beyond the data of HfO2."""
BASE = {"--layer": "1.46", "--substrate": "3.9", "--thickness": "10:800"}


@pytest.fixture
def check_refused(pellicle, tmp_path):
    """Run `fit` with flags beside or instead of those of a scene; it must fail and write nothing."""

    def run(code, words, *data, flags=""):
        given = shlex.split(flags)
        given = BASE | dict(zip(given[::2], given[1::2], strict=True)) if "--recipe" not in data else {}
        before = sorted(tmp_path.rglob("*"))
        arguments = (*data, *(x for pair in given.items() for x in pair))
        pellicle("fit", *arguments, "--out", tmp_path / "out").refused(code, *words)
        assert [p for p in sorted(tmp_path.rglob("*")) if p != tmp_path / "out"] == before
        assert not list((tmp_path / "out").glob("*"))

    return run


@pytest.mark.parametrize(
    ("text", "flags", "words"),
    [
        (f"wavelength,R\n{ROWS}500,31.5\n", "", ("line 12", "--signal-unit percent")),
        (f"wavelength,R\n{FAR_ROWS}{ROWS}", "--layer HfO2", ("HfO2", "250 to 900 nm", "--range")),
        (f"wavelength,intensity\n{ROWS}", "--signal R", ("--scale slow",)),
        ("wavelength,psi,delta\n400,20,90\n500,21,90\n", "", ("angle of incidence", "--angle 70")),
        (
            "wavelength_nm,R\n" + "".join(f"0.{400 + 10 * i},0.{20 + i}\n" for i in range(10)),
            "",
            ("end at 0.49", "like µm", "--wavelength-unit um"),
        ),
        ("wavelength_nm,R\n" + ROWS.replace("0.", "0,"), "", ("line 2", "semicolons", "decimal commas")),
    ],
    ids=["percent", "outside of a material's table", "intensity", "angle", "micrometres", "decimal commas"],
)
def test_data(check_refused, write, text, flags, words):
    file = write(text)
    check_refused(3, (str(file), *words), file, flags=flags)


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        ("--thickness 800:10", ("--thickness", "reversed")),
        ("--thickness 300", ("nothing is free",)),
        ("--thickness 1:1e300", ("--thickness", "a metre", "1e+300")),
        ("--range 700:400", ("--range", "reversed")),
        ("--angle 95", ("--angle", "95")),
        ("--signal X", ("--signal", "'X'")),
        ("--scale loose", ("--scale", "'loose'")),
        ("--noise -1", ("--noise",)),
        ("--layer 'cauchy(1.45,0.0035)'", ("µm²", "write 3500")),
        ("--free q", ("free 'q'",)),
        ("--free thickness", ("its bounds free it", "--thickness 10:1000")),
        ("--plate-mm 1", ("--plate-mm", "--back")),
        ("--back air --plate-mm 0", ("--plate-mm", "above zero")),
        ("--wavelength-unit inch", ("--wavelength-unit", "'inch'", "um")),
        ("--dark dark.csv", ("--dark", "--reference")),
        ("--layer bruggeman", ("bruggeman", "recipe")),
        ("--layer SiO2,TiO2", ("one layer", "[[scene.layer]]")),
        ("--layer 'cauchy(1.45,3000'", ("not closed", "write cauchy(1.45,3000)")),
        ("--layer hematit", ("hematit", "hematite")),
        ("--layer Unobtainium", ("Unobtainium", "pellicle materials")),
    ],
)
def test_flags(check_refused, spectrum_file, flags, words):
    check_refused(2, words, spectrum_file(), flags=flags)


FILM = "[scene]\nsubstrate = {}\n[[scene.layer]]\nmaterial = {}\nthickness = {}\n"
PLATE = "{ material = 'SiO2', back = 'air', plate_mm = 0 }"


@pytest.mark.parametrize(
    ("recipe", "words"),
    [
        ("[scene\n", ("is not TOML", "line 1")),
        (FILM.format("'Si'", "'SiO3'", 10), ("SiO3", "SiO2")),
        (
            FILM.format("'Si'", 1.46, "{ lower = 1, upper = 9, prior = 'x' }"),
            ("prior is a table of mean, sd", "'x'"),
        ),
        (FILM.format("'Si'", 1.46, "{ lower = 'a', upper = 9 }"), ("thickness.lower", "number", "'a'")),
        (FILM.format(PLATE, 1.46, "{ lower = 1, upper = 9 }"), ("film.toml: plate_mm must be above 0 mm",)),
    ],
)
def test_recipes(check_refused, spectrum_file, write, recipe, words):
    """Of what the tables and the scene refuse; tests/recipes has every case."""
    path = write(recipe, "film.toml")
    check_refused(3, (str(path), *words), spectrum_file(), "--recipe", path)


@pytest.mark.parametrize(("grid", "said"), [("1e-9, stop = 500", "larger"), ("0.1, stop = inf", "finite")])
def test_a_grid_without_end(pellicle, write, tmp_path, grid, said):
    data = f"[data]\nwavelengths = {{ start = 400, step = {grid} }}\n"
    path = write(data + FILM.format("'Si'", 1.46, 100), "film.toml")
    pellicle("simulate", path, "--out", tmp_path / "out.csv").refused(3, f"{path}: ", "wavelengths", said)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("fit a.csv --tickness 3", 2, "--thickness"),
        ("fit a.csv --thickness", 2, "requires an argument"),
        ("fit a.csv --plate-mm thin", 2, "thin"),
        ("fit", 2, "no data"),
        ("fit a.csv", 2, "--layer is missing"),
        ("fit a.csv --layer SiO2", 2, "--substrate is missing"),
        ("fitt", 2, "fitt"),
        ("simulate", 2, "recipe"),
        ("plan gone.toml", 3, "gone.toml"),
    ],
)
def test_wrong_usage_is_a_json_object_with_the_exit_code(pellicle, words, code, said):
    ran = pellicle(*words.split(), "--json")
    (record,) = ran.objects
    assert (ran.code, record["exit_code"], record["status"]) == (code, code, "failed")
    assert said in record["error"]
    assert said in ran.err
    assert pellicle(*words.split()).out == ""


def test_a_recipe_in_place_of_data_and_data_in_place_of_a_recipe(pellicle, write):
    recipe, data = write("[scene]\n", "film.toml"), write(f"wavelength,R\n{ROWS}")
    pellicle("fit", recipe).refused(2, f"{recipe}: is a recipe", f"--recipe {recipe}")
    pellicle("fit", data, "--layer", "A", "--layer=B").refused(2, "--layer is given twice", "[[scene.layer]]")
    pellicle("explore", data).refused(2, f"{data}: is data", "[data] files")
