"""Output on consoles whose encoding lacks signs."""

import io
import sys

import pytest

from pellicle.cli.console import print_every_sign

TEXT = "χ² 1.2 at 3 µm, Δ and ψ ≤ 90°, n − k, Δχ², ε₀, ± 2, é"


@pytest.mark.parametrize(
    ("encoding", "printed"),
    [
        ("utf-8", TEXT),
        ("cp1252", "chi² 1.2 at 3 µm, Delta and psi <= 90°, n - k, Deltachi², epsilon0, ± 2, é"),
        ("cp437", "chi² 1.2 at 3 µm, Delta and psi ≤ 90°, n - k, Deltachi², ε0, ± 2, é"),
        ("ascii", "chi2 1.2 at 3 um, Delta and psi <= 90 deg, n - k, Deltachi2, epsilon0, +- 2, e"),
    ],
)
def test_signs_that_a_console_lacks_are_written_out(monkeypatch, encoding, printed):
    buffer = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(buffer, encoding))
    monkeypatch.setattr(sys, "stderr", io.StringIO())  # has no encoding
    print_every_sign()
    print(TEXT, end="", flush=True)
    assert buffer.getvalue().decode(encoding) == printed
