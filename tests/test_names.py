"""The names that `import pellicle` offers."""

import ast
import inspect

import pytest

import pellicle as pl
from pellicle.dispersion import effective_medium, empirical, oscillators, spline
from pellicle.dispersion.cody_lorentz import CodyLorentz


def test_every_name_loads_and_type_checkers_see_the_same():
    assert all(getattr(pl, name).__name__ for name in pl.__all__)
    assert set(pl.__all__) < set(dir(pl))
    imports = [x for x in ast.walk(ast.parse(inspect.getsource(pl))) if isinstance(x, ast.ImportFrom)]
    seen = {
        alias.asname or alias.name
        for x in imports
        if (x.module or "").startswith("pellicle.")
        for alias in x.names
    }
    assert {"material" if name == "lookup" else name for name in seen} == set(pl.__all__)
    with pytest.raises(AttributeError, match="Lorenz"):
        pl.Lorenz  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_every_model_of_a_medium_is_offered():
    """All but `Sampled`, which is made of another model for the fit."""
    kinds = (empirical.AbstractDispersion, oscillators.AbstractOscillator)
    models = {
        value
        for module in (empirical, oscillators, effective_medium, spline)
        for value in vars(module).values()
        if inspect.isclass(value) and issubclass(value, kinds) and value not in kinds
    } | {CodyLorentz}
    offered = {getattr(pl, name) for name in pl.__all__}
    assert models - offered == {empirical.Sampled}
