"""Flags of the light from the back face of a plate."""

import pytest

from pellicle.cli.flags import SceneFlags
from pellicle.data.options import FileOptions
from pellicle.errors import UsageError


def substrate(signal: str = "R", **flags):
    given = SceneFlags(layer="SiO2", substrate="BK7", **flags)
    return given.scene(FileOptions(signal=signal)).substrate


def test_a_share_and_a_number_of_reflections():
    assert substrate(back="air", back_collected="0.4").back_collected == 0.4
    free = substrate(back="air", back_collected="free", back_reflections=2)
    assert (free.back_collected.lower, free.back_collected.upper, free.back_reflections) == (0, 1, 2)
    assert substrate(back="air", back_collected="0.2:0.8").back_collected.upper == 0.8


@pytest.mark.parametrize("word", ["rough", "taped"])
def test_a_back_that_returns_nothing(word):
    assert substrate(back=word).back_collected == 0.0
    with pytest.raises(UsageError, match="its transmittance is not simulated"):
        substrate("T", back=word)
    with pytest.raises(UsageError, match="leave out `back_collected`"):
        substrate(back=word, back_collected="0.5")


def test_a_share_needs_a_back():
    with pytest.raises(UsageError, match="`back_collected` needs the medium behind the plate"):
        substrate(back_collected="0.5")
