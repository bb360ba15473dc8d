"""`pellicle doctor`: what a report of a fault needs, without the user's name."""

import sys
from importlib.metadata import version
from pathlib import Path


def test_versions_cache_and_extras(pellicle, monkeypatch, tmp_path):
    ran = pellicle("doctor", code=0)
    lines = dict(line.split(maxsplit=1) for line in ran.out.splitlines())
    assert lines["jax"] == version("jax")
    assert lines["cache"] == "off"
    assert f"emcee {version('emcee')}" in lines["[posterior]"]
    assert "[dev]" not in lines
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.setenv("PELLICLE_CACHE", str(tmp_path / "programs"))
    (tmp_path / "programs").mkdir()
    (tmp_path / "programs" / "one").write_bytes(bytes(3 * 2**20))
    monkeypatch.setattr(
        sys.modules["pellicle.cli.doctor"], "requires", lambda name: ['nowhere-at-all; extra == "maps"']
    )
    ran = pellicle("doctor", code=0)
    assert "~/programs, 1 files, 3 MiB" in ran.out
    assert "nowhere-at-all absent" in ran.out
