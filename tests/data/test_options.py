"""Words of flags: lengths with their units, ranges as people write them, angles and signals."""

import pytest

from pellicle.data.options import is_range, length_range, parse_angles, parse_length, parse_signal
from pellicle.errors import UsageError


@pytest.mark.parametrize(
    "text", ["400:800", "400-800", "0.4-0.8um", "400 nm to 800 nm", "0.4um:0.8um", "400–800", "4000:8000A"]
)
def test_a_range_of_lengths(text):
    assert is_range(text)
    assert length_range(text, "`range`") == pytest.approx((400, 800))


@pytest.mark.parametrize(
    ("text", "nm"), [("1.5um", 1500), ("1.5 µm", 1500), ("12 Å", 1.2), ("3nm", 3), ("1e-5", 1e-5)]
)
def test_a_length(text, nm):
    assert not is_range(text)
    assert parse_length(text, "`thickness`") == pytest.approx(nm)


@pytest.mark.parametrize("text", ["um", "3 furlongs", "400-800-900", "800-400"])
def test_others_are_refused(text, refuses):
    refuses(UsageError, "`range`", length_range, text if "-" in text else f"{text}:1", "`range`")


def test_angles_and_signals():
    assert parse_angles("70deg", "`angle`") == parse_angles("70°", "`angle`") == 70
    assert parse_angles("0,30, 60 degrees", "`angle`") == [0, 30, 60]
    words = ("Reflectance", "transmission", "r", "sRGB", "psi-delta", "X")
    assert [parse_signal(word) for word in words] == ["R", "T", "R", "srgb", "psi-delta", "X"]
