"""Every bad input: one sentence with what and where and how to mend it, the right code, no trace."""

import pytest


@pytest.fixture
def check_refused(pellicle, tmp_path):
    """Runs a command that must fail: exactly one line of complaint, no result, nothing written."""

    def run(*arguments, code: int, said: tuple[str, ...]):
        before = sorted(tmp_path.rglob("*"))
        pellicle(*arguments, "--out", tmp_path / "out").refused(code, *said)
        assert [p for p in sorted(tmp_path.rglob("*")) if p != tmp_path / "out"] == before
        assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())

    return run


ROWS = "".join(f"{400 + 10 * i},0.{20 + i}\n" for i in range(10))


def test_outside_a_materials_table(check_refused, spectrum_file):
    file = spectrum_file()
    text = file.read_text().replace("400,", "200,").replace("404,", "201,")
    file.write_text(text)
    flags = ("--layer", "HfO2", "--substrate", "3.9", "--thickness", "10:800")
    check_refused("fit", file, *flags, code=3, said=(str(file), "HfO2", "250 to 900 nm", "--range"))


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--thickness", "800:10"), ("--thickness", "reversed")),
        (("--thickness", "300"), ("nothing is free",)),
        (("--range", "700:400"), ("--range", "reversed")),
        (("--angle", "95"), ("--angle", "95")),
        (("--signal", "X"), ("--signal", "'X'")),
        (("--scale", "loose"), ("--scale", "'loose'")),
        (("--noise", "-1"), ("--noise",)),
        (("--noise", "2 %"), ("--noise", "share of the signal", "BRDF")),
        (("--free", "q"), ("free 'q'",)),
        (("--plate-mm", "1"), ("--plate-mm", "--back")),
        (("--wavelength-unit", "inch"), ("--wavelength-unit", "'inch'", "um")),
        (("--dark", "dark.csv"), ("--dark", "--reference")),
        (("--layer", "bruggeman"), ("bruggeman", "recipe")),
        (("--thickness", "1:1e300"), ("--thickness", "a metre", "1e+300")),
    ],
    ids=lambda value: " ".join(value),
)
def test_flags(check_refused, spectrum_file, flags, said):
    base = {"--layer": "1.46", "--substrate": "3.9", "--thickness": "10:800"}
    given = base | dict(zip(flags[::2], flags[1::2], strict=True))
    check_refused("fit", spectrum_file(), *(x for pair in given.items() for x in pair), code=2, said=said)


def test_missing_layer_substrate_and_data(check_refused, spectrum_file):
    check_refused("fit", spectrum_file(), "--substrate", "Si", code=2, said=("--layer is missing",))
    check_refused("fit", spectrum_file(), "--layer", "SiO2", code=2, said=("--substrate is missing",))
    check_refused("fit", code=2, said=("no data",))


def test_an_intensity_without_a_scale(check_refused, write, scene):
    file = write("wavelength,intensity\n" + ROWS, "counts.csv")
    said = (str(file), "--scale slow")
    check_refused("fit", file, *scene, "--signal", "R", code=3, said=said)


@pytest.mark.parametrize(
    ("recipe", "said"),
    [
        ("[scene\n", ("is not TOML", "line 1")),
        ("[scene]\nsubstrate = 'Si'\n[[scene.layer]]\nmaterial = 'SiO3'\nthickness = 10\n", ("SiO3", "SiO2")),
    ],
)
def test_recipes(check_refused, write, recipe, said):
    """Of what the tables and the scene refuse; tests/recipes has every case."""
    path = write(recipe, "film.toml")
    check_refused("fit", "a.csv", "--recipe", path, code=3, said=(str(path), *said))


def test_psi_and_delta_without_an_angle(check_refused, write, scene):
    file = write(
        "wavelength,psi,delta\n" + "".join(f"{400 + 10 * i},{20 + i},100\n" for i in range(10)), "psi.csv"
    )
    check_refused("fit", file, *scene, code=3, said=(str(file), "angle of incidence", "--angle 70"))


@pytest.mark.parametrize("step", ["1e-9", "0.1, stop = inf"])
def test_a_grid_without_end(pellicle, tmp_path, step):
    path = tmp_path / "film.toml"
    stop = "" if "stop" in step else ", stop = 500"
    path.write_text(
        f"[data]\nwavelengths = {{ start = 400, step = {step}{stop} }}\n[scene]\nsubstrate = 'Si'\n"
        "[[scene.layer]]\nmaterial = 1.46\nthickness = 100\n"
    )
    pellicle("simulate", path, "--out", tmp_path / "out.csv").refused(
        3, f"{path}: ", "wavelengths", "larger step" if "e-9" in step else "finite"
    )


def test_a_plate_without_thickness(check_refused, tmp_path, spectrum_file, scene):
    path, file = tmp_path / "film.toml", spectrum_file()
    path.write_text(
        "[scene]\nsubstrate = { material = 'SiO2', back = 'air', plate_mm = 0 }\n[[scene.layer]]\n"
        "material = 1.46\nthickness = { lower = 1, upper = 9 }\n"
    )
    check_refused("fit", file, "--recipe", path, code=3, said=("film.toml: plate_mm must be above 0 mm",))
    check_refused(
        "fit", file, *scene, "--back", "air", "--plate-mm", 0, code=2, said=("--plate-mm", "above zero")
    )


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("fit", "a.csv", "--tickness", "3"), 2, "--thickness"),
        (("fit", "a.csv", "--thickness"), 2, "requires an argument"),
        (("fit", "a.csv", "--plate-mm", "thin"), 2, "thin"),
        (("fitt",), 2, "fitt"),
        (("simulate",), 2, "recipe"),
        (("fit", "a.csv"), 2, "--layer is missing"),
        (("plan", "gone.toml"), 3, "gone.toml"),
    ],
)
def test_wrong_usage_is_a_json_object_with_the_exit_code(pellicle, words, code, said):
    ran = pellicle(*words, "--json")
    (record,) = ran.objects
    assert (ran.code, record["exit_code"], record["status"]) == (code, code, "failed")
    assert said in record["error"]
    assert said in ran.err
    assert pellicle(*words).out == ""
