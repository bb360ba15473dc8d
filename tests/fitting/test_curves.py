"""Curves that are computed when they are read."""

import pickle

import numpy as np

from pellicle.fitting.curves import BrdfCurve, Deferred


def test_curves_are_computed_once_when_one_is_read():
    computed = []

    def compute():
        computed.append(True)
        return tuple(BrdfCurve(np.full(2, float(i)), np.zeros(2)) for i in range(2))

    curves = Deferred(2, compute)
    assert len(curves) == 2
    assert not computed
    assert curves[1].model.tolist() == [1.0, 1.0]
    assert [curve.model[0] for curve in curves] == [0.0, 1.0]
    assert [curve.model[0] for curve in pickle.loads(pickle.dumps(curves))] == [0.0, 1.0]
    assert computed == [True]
