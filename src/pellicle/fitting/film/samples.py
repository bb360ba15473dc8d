"""Several samples in one fit: scenes with the names of their samples, and checks of what they share."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax

from pellicle.errors import UsageError, did_you_mean
from pellicle.scene.film import Scene
from pellicle.scene.free import Content, Free, free_leaves, is_free
from pellicle.scene.layers import Interface
from pellicle.scene.names import aliases_of, layer_name, location_of, name_in_fit
from pellicle.scene.samples import Sample, as_sample


def joined(scenes: Sequence[Scene], names: Sequence[str], shared: Sequence[str] | None) -> list[Scene]:
    """Return the scenes of a joint fit, one for each measurement, with what their samples share.

    Scenes whose `sample` has one name are of one sample; a scene without takes its name of `names`. Without
    `shared` and samples all scenes are of one. **Raises:** UsageError where scenes of one sample differ, for
    an unknown shared number, and for one with two bounds.
    """
    if shared is None and all(scene.sample is None for scene in scenes):
        _check_one(scenes)
        return [*scenes]
    if shared is not None:
        if isinstance(shared, str) or not all(isinstance(name, str) for name in shared):
            raise UsageError(f"`shared` is a list of names, as in shared=['film.n'], not {shared!r}")
        pairs = zip(scenes, names, strict=True)
        scenes = [_named(scene, (scene.sample or as_sample(name)), shared) for scene, name in pairs]
    by_sample: dict[str, list[Scene]] = {}
    for scene in scenes:
        if scene.sample is None:
            raise UsageError("some scenes of a joint fit have a `sample` and some have none: name all")
        by_sample.setdefault(scene.sample.name, []).append(scene)
    for name, own in by_sample.items():
        _check_one(own, f"sample {name}: ")
    firsts = [own[0] for own in by_sample.values()]
    every = [_free_numbers(s) for s in firsts]
    wanted = dict.fromkeys(shared or (x for s in firsts if s.sample for x in s.sample.shared))
    known = [name for name in wanted if _stands_in(name, firsts, every, explicit=shared is not None)]
    if not known:
        raise UsageError(
            f"the {len(firsts)} samples of this fit share no free number: name one that several have in"
            " `shared`, or fit them one by one"
        )
    media = {name: _media(own[0], known) for name, own in by_sample.items()}
    common = {}
    for name, own in media.items():
        alike = {owner: [n for n, m in media.items() if m.get(owner) == x] for owner, x in own.items()}
        having = {owner: sum(owner in m for m in media.values()) for owner in own}
        common[name] = tuple(
            (owner, "" if len(names) == having[owner] else f" of {names[0]}")
            for owner, names in alike.items()
        )
    return [_named(s, s.sample, known, common[s.sample.name]) for s in scenes if s.sample is not None]


def _free_numbers(scene: Scene) -> dict[str, Free]:
    """Free numbers of a scene by the names that `shared` may have for them."""
    leaves = free_leaves(scene)
    return {name: x for path, x in leaves for name in aliases_of(scene, path, location_of(scene, path).name)}


def shared_by_each(scenes: Mapping[str, Any], shared: Sequence[str] | None) -> dict[str, list[str] | None]:
    """Names of `shared` numbers that each description, a scene or a list of some, has free.

    Raises UsageError for one that none has.
    """
    if shared is None:
        return dict.fromkeys(scenes)
    known = {
        name: {
            x
            for s in (own if isinstance(own, list | tuple) else [own])
            if isinstance(s, Scene)
            for x in _free_numbers(s)
        }
        for name, own in scenes.items()
    }
    every = set[str]().union(*known.values())
    for name in shared:
        if name not in every:
            raise UsageError(
                f"the shared number {name!r} is free in no description{did_you_mean(name, sorted(every))}"
            )
    return {name: [x for x in shared if x in own] for name, own in known.items()}


def _named(scene: Scene, sample: Any, shared: Iterable[str], common: Any = ()) -> Scene:
    own = shared if not sample.shared else [name for name in shared if name in sample.shared]
    return replace(scene, sample=Sample(sample.name, tuple(own), common))


def _check_one(scenes: Sequence[Scene], of: str = "") -> None:
    """Raise UsageError unless the scenes are of one sample."""
    about = [(s.layers, s.ambient, s.substrate) for s in scenes]
    samples = [(*rest, x.material, x.plate_mm, x.roughness) for *rest, x in about]
    if not all(eqx.tree_equal(sample, samples[0]) is True for sample in samples[1:]):
        raise UsageError(
            f"{of}the scenes of one sample must have the same layers, ambient and substrate; of several"
            " samples `shared` names the numbers that they have in common, as in shared=['film.n']"
        )


def _stands_in(
    name: str, scenes: Sequence[Scene], every: Sequence[dict[str, Free]], *, explicit: bool
) -> bool:
    """True for a name of a free number of two samples or more. Raises UsageError where one that is asked for
    is none, and where its bounds differ."""
    taking = [(s.sample, own[name]) for s, own in zip(scenes, every, strict=True) if name in own]
    taking = [(sample, free) for sample, free in taking if sample and name in sample.shared]
    if len(taking) < 2:
        if not explicit:
            return False
        known = dict.fromkeys(name for own in every for name in own)
        near = did_you_mean(name, [*known])
        only = f"free in sample {taking[0][0].name} alone" if taking else f"free in no sample{near}"
        raise UsageError(f"the shared number {name!r} is {only}; free numbers are {', '.join(known)}")
    (first, one), *others = taking
    for sample, free in others:
        if (free.lower, free.upper, free.prior) != (one.lower, one.upper, one.prior):
            bounds = " and ".join(
                f"{x.lower:g} to {x.upper:g}{' with a prior' if x.prior else ''} in sample {s.name}"
                for s, x in ((first, one), (sample, free))
            )
            raise UsageError(f"the shared number {name!r} has two bounds, {bounds}: give it the same in both")
    return True


def _media(scene: Scene, shared: Iterable[str]) -> dict[str, Content]:
    """Media of layers and substrate by their owners, with the names of free numbers in the fit."""
    scene = _named(scene, scene.sample, shared)

    def named(path: tuple, x: Any) -> Any:
        return name_in_fit(scene, path, location_of(scene, path).name) if is_free(x) else x

    called = jax.tree_util.tree_map_with_path(named, scene, is_leaf=is_free)
    layers = {
        layer_name(scene, i): x.material for i, x in enumerate(called.layers) if not isinstance(x, Interface)
    }
    return {own: Content(x) for own, x in (layers | {"substrate": called.substrate.material}).items()}
