"""A short run of the damaged and random files that `make fuzz` gives to every reader."""

import pytest


@pytest.fixture(scope="module")
def fuzz(load_script):
    return load_script("benchmarks/fuzz_readers.py")


@pytest.mark.slow
def test_every_file_is_read_or_refused_in_one_sentence(fuzz, tmp_path):
    outcomes, failures = fuzz.run(150, tmp_path)
    assert not failures
    assert outcomes["inputs"] == 150
    assert outcomes["read_spectra: read"] > 0  # one in 25: most damaged files are refused


def test_a_reader_that_fails_is_found(fuzz, tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "readers", lambda path, words: {"broken": lambda: {}["absent"]})
    outcomes, failures = fuzz.run(3, tmp_path)
    assert outcomes["broken: failed"] == 3
    assert "KeyError" in failures[0]
