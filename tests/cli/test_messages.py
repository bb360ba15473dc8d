"""Arguments in messages of the library become flags on the command line."""

import json
import logging

import pytest

from pellicle.cli import app, main
from pellicle.cli.messages import as_flags, flag_names, log_to_stderr, say


@pytest.mark.parametrize(
    ("argument", "flag"),
    [
        ("thickness", "--thickness"),
        ("reference_material", "--reference-material"),
        ("folder", "--out"),
        ("angle=70", "--angle 70"),
        ('scale="slow"', "--scale slow"),
        ("substrate=2.9+0.1j", "--substrate 2.9+0.1j"),
        ('layer="cauchy(1.46,3000)"', "--layer 'cauchy(1.46,3000)'"),
        ('columns="wavelength,R,_,sigma"', "--columns wavelength,R,_,sigma"),
        ('columns=["wavelength", "R"]', "--columns wavelength,R"),
        ("range=(400, 900)", "--range 400:900"),
        ("range=(400, inf)", "--range 400:inf"),
        ("thickness=Free(10, 3000)", "--thickness 10:3000"),
        ("folded=True", "--folded"),
        ("folded=False", "--no-folded"),
        ("columns=...", "--columns ..."),
        ('layer="SiO2", substrate="Si"', "--layer SiO2 --substrate Si"),
    ],
)
def test_an_argument_becomes_its_flag(argument, flag):
    assert as_flags(f"film.csv: give `{argument}`, or more") == f"film.csv: give {flag}, or more"


@pytest.mark.parametrize(
    "text",
    [
        "`thicknes`",
        '`angle=70, weight="slow"`',
        "`noise=False`",
        "`scene.thickness`",
        "`[data] angle = 70`",
        "`angle=`",
        "`thickness=Free(10, 3000, start=5)`",
        "`Free(10, 3000)`",
        "a ` alone",
        "an angle, a layer and thickness=3 in plain words",
    ],
)
def test_any_other_text_stays(text):
    assert as_flags(text) == text


def test_several_arguments_in_one_sentence():
    assert as_flags('give `signal="R"` or `signal="T"`') == "give --signal R or --signal T"


def test_every_flag_of_a_command_can_be_named_and_every_name_is_a_flag():
    commands = [name for name in app if not name.startswith("-")]
    arguments = [argument for name in commands for argument in app[name].assemble_argument_collection()]
    flags = {argument.name for argument in arguments if argument.name.startswith("--")}
    assert set(flag_names().values()) <= flags
    positional = {"--film", "--data", "--folder", "--name"}
    assert flags - set(flag_names().values()) == positional


def test_messages_on_stderr(monkeypatch, capsys):
    """Errors of any command, talk, and steps of --verbose."""

    def refused(*_):
        raise ValueError('film.csv: uncalibrated: give `scale="slow"`')

    say("counts.csv: `signal` is not given")
    with log_to_stderr():
        logging.getLogger("pellicle").info("give `angle=70`")
    monkeypatch.setattr("pellicle.cli.command", refused)
    assert main() == 3
    assert capsys.readouterr().err.splitlines()[-1] == "pellicle: film.csv: uncalibrated: give --scale slow"


@pytest.fixture
def doubtful(monkeypatch):
    """Makes every fit of spectra warn, and name an argument in its verdict."""
    from dataclasses import replace

    from pellicle.api import fits

    real = fits.fit

    def fit(*arguments, **options):
        result = real(*arguments, **options)
        return replace(result, verdict="Give `angle=70`.", warnings=("noise: give `noise=0.01`",))

    monkeypatch.setattr(fits, "fit", fit)


@pytest.mark.usefixtures("doubtful")
def test_verdict_and_warnings_of_a_fit(pellicle, spectrum_file, scene, tmp_path):
    ran = pellicle("fit", spectrum_file(), *scene, "--out", tmp_path / "out")
    assert "Give --angle 70." in ran.out
    assert "noise: give --noise 0.01" in ran.out
    assert (tmp_path / "out" / "report.txt").read_text() == ran.out.removesuffix("\n")
    record = json.loads((tmp_path / "out" / "result.json").read_text())
    assert (record["verdict"], record["warnings"]) == ("Give --angle 70.", ["noise: give --noise 0.01"])
