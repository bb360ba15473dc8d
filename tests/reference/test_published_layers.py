"""Published numbers of birefringent and graded layers, which docs/published.md lists."""

import pytest


@pytest.fixture(scope="module")
def published(load_script):
    return load_script("benchmarks/published.py")


@pytest.mark.parametrize(
    "study",
    [
        "sapphire_window",
        "brewster_angles",
        *(pytest.param(long, marks=pytest.mark.slow) for long in ("gooch_tarry", "rugate_filters")),
    ],
)
def test_numbers_are_those_published(published, study):
    for row in getattr(published, study)():
        assert row.computed == pytest.approx(row.published, abs=row.tolerance), row.quantity
