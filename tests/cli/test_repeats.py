"""`pellicle fit --repeats`: files of one spot, fitted one by one and compared."""

import csv
import html
import json
import math

import numpy as np
import pytest


@pytest.mark.slow
def test_repeats_of_one_thickness_agree(pellicle, spectrum_file, scene, tmp_path):
    files = [spectrum_file(f"{seed}.csv", seed=seed) for seed in range(4)]
    out = tmp_path / "out"
    flags = ("--repeats", "--json", "--out", out, "--jobs", "2")
    *fits, found = pellicle("fit", *files, *scene, *flags, code=0).objects
    assert [fit["schema"] for fit in fits] == ["pellicle.fit/1"] * 4
    assert found["schema"] == "pellicle.repeats/1"
    assert [each["path"] for each in found["data"]] == list(map(str, files))
    values = [fit["parameters"]["thickness"]["value"] for fit in fits]
    thickness = found["parameters"]["thickness"]
    assert thickness["values"] == values
    assert thickness["mean"] == pytest.approx(np.mean(values))
    assert thickness["sd"] == pytest.approx(np.std(values, ddof=1))
    assert thickness["agreement"] == "agrees"
    assert abs(thickness["mean"] - 300.0) < thickness["expanded"]
    assert json.loads((out / "repeats.json").read_text())["parameters"] == found["parameters"]
    [row] = csv.DictReader((out / "repeats.csv").read_text().splitlines()[1:])
    assert float(row["sd_mean"]) == pytest.approx(np.std(values, ddof=1) / math.sqrt(4))
    assert "[[Repeats]]" in (out / "repeats.txt").read_text()
    page = (out / "report.html").read_text()
    scatter = page[page.index('id="repeats-head"') : page.index('id="files"')]
    assert html.escape(found["verdict"]) in scatter
    assert f'<td class="number">{found["parameters"]["thickness"]["mean"]:.7g}</td>' in scatter
    assert (out / "summary.csv").exists()


def test_thicknesses_that_differ_are_told(pellicle, spectrum_file, scene_recipe):
    for name, thickness in zip("abc", (299.0, 300.0, 301.5), strict=True):
        spectrum_file(f"{name}.csv", thickness)
    recipe = scene_recipe("files = ['a.csv', 'b.csv', 'c.csv']\nrepeats = true")
    ran = pellicle("fit", "--recipe", recipe, code=0)
    assert ran.out.count("[[Verdict]]") == 3
    assert "the stated noise error is too small" in " ".join(ran.out.split())


def test_a_file_that_cannot_be_read_is_not_waited_for(pellicle, spectrum_file, scene, tmp_path):
    ran = pellicle("fit", spectrum_file(), tmp_path / "gone.csv", *scene, "--repeats", "--json", code=3)
    assert "repeats need two usable fits" in ran.err
    failed = ran.objects[-1]
    assert (failed["schema"], failed["status"]) == ("pellicle.repeats/1", "failed")


def test_what_repeats_are_not(pellicle, spectrum_file, scene, scene_recipe):
    file = spectrum_file()
    pellicle("fit", file, *scene, "--repeats").refused(2, "two files or more", "--repeats")
    pellicle("fit", file, file, *scene, "--repeats", "--joint").refused(2, "one by one", "choose one")
    path = scene_recipe("joint = true\nrepeats = true")
    pellicle("fit", file, "--recipe", path).refused(3, "joint and repeats exclude each other")


def test_sweeps_of_one_file_are_repeats(pellicle, spectrum_file, scene, tmp_path):
    texts = [spectrum_file(f"{seed}.csv", seed=seed).read_text().split("\n", 1) for seed in range(3)]
    together = tmp_path / "sweeps.csv"
    together.write_text(texts[0][0] + "\n" + "".join(rows for _, rows in texts))
    mean = pellicle("fit", together, *scene, "--json").objects[0]
    assert mean["data"]["points"] == 100
    assert mean["data"]["sweeps"]["number"] == 3
    assert abs(mean["data"]["sweeps"]["sd"] - 0.002) < 0.0003
    each = pellicle("fit", together, *scene, "--repeats", "--json").objects
    alone = pellicle("fit", *(tmp_path / f"{seed}.csv" for seed in range(3)), *scene, "--repeats", "--json")
    assert each[-1]["parameters"] == alone.objects[-1]["parameters"]
    assert [x["path"] for x in each[-1]["data"]] == [f"{together} ({i})" for i in (1, 2, 3)]


def test_other_commands_ignore_the_key(pellicle, spectrum_file, scene_recipe, tmp_path):
    """A recipe of repeats still describes one scene: `compare` takes one file of it."""
    path = scene_recipe("repeats = true")
    other = tmp_path / "other.toml"
    other.write_text(path.read_text().replace("1.46", "1.5"))
    assert pellicle("compare", spectrum_file(), "--recipe", path, "--recipe", other).code in (0, 4)
