"""`pellicle warm`: programs that are compiled and kept before the first fit."""

import os
import subprocess
import sys

import pytest

from pellicle.programs import cache


def test_within_it_programs_are_compiled_at_their_first_call(monkeypatch):
    monkeypatch.setattr(cache, "_spent_on", lambda *program: [0.0])
    assert cache._is_new(("program", None), 0.1)
    with cache.compiled_at_once():
        assert not cache._is_new(("program", None), 0.1)
    assert cache._is_new(("program", None), 0.1)


@pytest.mark.slow
def test_a_fit_after_it_compiles_nothing(spectrum_file, scene, tmp_path):
    files = spectrum_file("measured.csv", 300.0), spectrum_file("later.csv", 420.0, seed=1)
    folder = tmp_path / "programs"
    kept = []
    for command, file in (("warm", files[0]), ("fit", files[1])):
        words = [sys.executable, "-m", "pellicle", command, str(file), *scene]
        environment = os.environ | {"PELLICLE_CACHE": str(folder)}
        ran = subprocess.run(words, capture_output=True, text=True, env=environment, check=False, timeout=300)
        assert ran.returncode == 0, ran.stderr
        kept.append({path.name for path in (folder / "programs").iterdir()})
        if command == "warm":
            assert f"flags: {len(kept[0])} programs compiled in " in ran.stderr
            assert not ran.stdout
    assert len(kept[0]) >= 4  # scan, polish, slopes, systematic effects
    assert kept[1] == kept[0]


def test_without_a_cache_there_is_nothing_to_prepare(spectrum_file, scene, pellicle):
    pellicle("warm", spectrum_file(), *scene).refused(2, "PELLICLE_CACHE is off")


def test_without_data_it_says_how_to_name_them(pellicle):
    pellicle("warm").refused(2, "no data")
