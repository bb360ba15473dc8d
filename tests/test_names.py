"""The names that `import pellicle` offers."""

import ast
import doctest
import inspect
import re
import typing
from importlib import import_module
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pellicle as pl
from pellicle.dispersion import effective_medium, empirical, oscillators, spline
from pellicle.dispersion.oscillators import CodyLorentz

NAMESPACES = ("dispersion", "fitting", "mixing", "priors", "profile")
PAGES = (Path(__file__).parents[1] / "docs" / "reference").glob("*.md")
LISTED = [
    name for page in PAGES for name in re.findall(r"^::: ([\w.]+)$", page.read_text("utf-8"), re.MULTILINE)
]


def in_namespaces():
    """Every class of the namespaces, and every name of `pl.fitting`, by the name that a user types."""
    models = {**vars(pl.dispersion), **vars(pl.mixing)}
    kinds = (empirical.AbstractDispersion, oscillators.AbstractOscillator)
    profiles = {f"profile.{name}": x for name, x in vars(pl.profile).items() if inspect.isclass(x)}
    profiles = {name: x for name, x in profiles.items() if issubclass(x, pl.profile.AbstractProfile)}
    found = {name: x for name, x in models.items() if inspect.isclass(x) and issubclass(x, kinds)}
    priors = {name: x for name, x in vars(pl.priors).items() if x in typing.get_args(pl.priors.Prior)}
    found |= {name: getattr(pl.fitting, name) for name in pl.fitting.__all__} | profiles
    return {name: x for name, x in {**found, **priors}.items() if "Abstract" not in name}


PUBLIC = {name: getattr(pl, name) for name in pl.__all__ if name not in NAMESPACES} | in_namespaces()


def test_every_name_loads_and_type_checkers_see_the_same():
    assert all(callable(getattr(pl, name)) for name in pl.__all__ if name not in NAMESPACES)
    assert all(inspect.ismodule(getattr(pl, name)) for name in NAMESPACES)
    assert set(pl.__all__) < set(dir(pl))
    stub = ast.parse(Path(pl.__file__).with_suffix(".pyi").read_text("utf-8")).body
    typed = {alias.asname for x in stub if isinstance(x, ast.ImportFrom) for alias in x.names if alias.asname}
    typed |= {ast.unparse(x.targets[0]) for x in stub if isinstance(x, ast.Assign)}
    assert typed == set(pl.__all__)
    with pytest.raises(AttributeError, match="Lorenz"):
        pl.Lorenz  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_no_name_is_shadowed_by_a_subpackage():
    """Importing `pellicle.x` sets `pl.x` to that module, whatever `pl.x` was before."""
    modules = {path.stem for path in Path(pl.__file__).parent.iterdir()}
    assert modules & set(pl.__all__) == {"dispersion", "fitting"}


def test_every_model_of_a_medium_is_offered():
    """All but `Tabulated` and `Scaled`, which a fit makes of another model."""
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
    assert models - offered == {empirical.Tabulated, empirical.Scaled}


def test_every_public_name_is_in_the_reference():
    def resolve(path):
        module, _, name = path.rpartition(".")
        return (
            import_module(path)
            if name.islower() and module == "pellicle.brdf"
            else vars(import_module(module))[name]
        )

    listed = [resolve(path) for path in LISTED]
    assert [name for name, x in PUBLIC.items() if not any(x is y for y in listed)] == []
    assert len(LISTED) == len(set(LISTED))


COMPILED = ("depth_profile", "fit", "solve", "field", "jones", "mueller", "repeats")
"""Their examples compile for a second or more."""


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=pytest.mark.slow) if x in COMPILED else x for x in PUBLIC]
)
def test_examples_in_docstrings_run(name):
    names = {"pl": pl, "np": np, "jnp": jnp, "jax": jax}
    finder, runner = doctest.DocTestFinder(recurse=False), doctest.DocTestRunner()
    for example in finder.find(PUBLIC[name], name, extraglobs=names):
        assert runner.run(example).failed == 0
