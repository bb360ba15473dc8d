"""Results that are kept by the content of scenes and arrays."""

import numpy as np

import pellicle as pl
from pellicle.fitting.film.problem import make, measured
from pellicle.scene.free import KEPT, Content, constant, remembered

NM = np.linspace(400.0, 800.0, 64)


def scene(thickness=None, **more) -> pl.Scene:
    return pl.Scene(pl.Layer(1.46, thickness or pl.Free(10, 500)), 3.9, **more)


SCENES = [
    scene(),
    scene(pl.Free(10, 501)),
    scene(100.0),
    scene(100.5),
    scene(uncertainty=pl.Uncertainty.none()),
]
NUMBERS = [(NM, "a"), (NM, "b"), (NM,), (NM[:, None],), (np.append(NM[:-1], 800.0 + 1e-9),)]
SCALARS = [(0,), (False,), (np.float64(1.0),), (np.float32(1.0),)]


def test_content():
    every = [Content(x) for x in (*SCENES, *NUMBERS, *SCALARS)]
    assert [[one == other for other in every] for one in every] == np.eye(len(every)).tolist()
    for one, other in ((scene(), scene()), ((NM, "a"), (NM.copy(), "a"))):
        assert Content(one) == Content(other)
        assert hash(Content(one)) == hash(Content(other))


def test_a_result_is_computed_once_for_equal_arguments_and_few_are_kept():
    calls = []

    @remembered
    def total(numbers: np.ndarray, factor: float) -> float:
        calls.append(factor)
        return float(factor * np.sum(numbers))

    assert total(NM, 2.0) == total(NM.copy(), 2.0) == total(constant(NM.copy()), 2.0) == 2 * NM.sum()
    assert calls == [2.0]
    assert total(NM + 1, 2.0) == 2 * NM.sum() + 128
    for factor in range(KEPT):
        total(NM, float(factor + 10))
    total(NM, 2.0)
    assert calls.count(2.0) == 3


def test_the_content_of_a_constant_is_read_once():
    numbers = constant(NM.copy())
    total = remembered(lambda numbers: float(numbers.sum()))
    before = total(numbers)
    numbers += 1.0  # what nobody may do
    assert total(numbers) == before
    assert total(numbers.copy()) == numbers.sum()


def test_spectra_of_one_scene_and_grid_share_its_structure():
    first, second = (pl.simulate(scene(float(d)), NM, noise=0.001) for d in (100, 200))
    longer = pl.simulate(scene(100.0), np.linspace(400.0, 801.0, 64), noise=0.001)
    problems = [make(measured(data, scene())) for data in (first, second, longer)]
    scenes = [problem.views[0].scene for problem in problems]
    assert scenes[0] is scenes[1]
    assert scenes[2].light.wavelength[-1] == 801.0
    assert np.any(problems[0].views[0].data.values != problems[1].views[0].data.values)
