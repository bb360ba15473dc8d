"""The names that `import pellicle` offers."""

import ast
import inspect
from pathlib import Path

import pytest

import pellicle as pl
from pellicle.dispersion import effective_medium, empirical, oscillators, spline
from pellicle.dispersion.cody_lorentz import CodyLorentz

NAMESPACES = ("dispersion", "mixing", "priors")


def test_every_name_loads_and_type_checkers_see_the_same():
    assert all(callable(getattr(pl, name)) for name in pl.__all__ if name not in NAMESPACES)
    assert all(inspect.ismodule(getattr(pl, name)) for name in NAMESPACES)
    assert set(pl.__all__) < set(dir(pl))
    imports = [x for x in ast.walk(ast.parse(inspect.getsource(pl))) if isinstance(x, ast.ImportFrom)]
    typed = {
        alias.asname or alias.name
        for x in imports
        if (x.module or "").startswith("pellicle")
        for alias in x.names
    }
    assert typed == set(pl.__all__)
    with pytest.raises(AttributeError, match="Lorenz"):
        pl.Lorenz  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_no_name_is_shadowed_by_a_subpackage():
    """Importing `pellicle.x` sets `pl.x` to that module, whatever `pl.x` was before."""
    modules = {path.stem for path in Path(pl.__file__).parent.iterdir()}
    assert modules & set(pl.__all__) == {"dispersion"}


def test_every_model_of_a_medium_is_offered():
    """All but `Sampled`, which is made of another model for the fit."""
    kinds = (empirical.AbstractDispersion, oscillators.AbstractOscillator)
    models = {
        value
        for module in (empirical, oscillators, effective_medium, spline)
        for value in vars(module).values()
        if inspect.isclass(value) and issubclass(value, kinds) and value not in kinds
    } | {CodyLorentz}
    offered = {
        x for module in (pl.dispersion, pl.mixing) for x in vars(module).values() if inspect.isclass(x)
    }
    assert models - offered == {empirical.Sampled}
