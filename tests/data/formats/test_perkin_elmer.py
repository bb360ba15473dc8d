"""Text files of PerkinElmer's UV WinLab (`PEDS`)."""

from __future__ import annotations

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import UsageError

PEDS = """\
PE UV       SUBTECH     SPECTRUM    ASCII       PEDS        4.00
   -1
film.Probe.Raw.asc
24/03/05
14:41:25.00
24/03/05
14:41:25.00
someone
film 7
800.000000
1
Lambda 1050
1050L0000000

0
#HDR
-1
-1
#GR
nm
%T
1.0
0.0
800.000000
-10.000000
3
8
90.0
10.0
#DATA
800.000000\t83.5
790.000000\t84.5
780.000000\t85.5
"""


def test_transmittance_in_percent(write):
    spectrum = read_spectrum(write(PEDS))
    assert spectrum.signal == "T"
    np.testing.assert_array_equal(spectrum.wavelength, [780, 790, 800])
    np.testing.assert_allclose(spectrum.values, [0.855, 0.845, 0.835], rtol=1e-15)
    np.testing.assert_array_equal(spectrum.lines, [33, 32, 31])
    assert dict(spectrum.declared) == {
        "format": "PerkinElmer PEDS text",
        "date": "24/03/05",
        "sample": "film 7",
        "instrument": "Lambda 1050",
    }


@pytest.mark.parametrize(("old", "new"), [("1.0\n0.0", "0.01\n0.0"), ("1.0\n0.0", "1.0\n2.5")])
def test_a_scaled_ordinate(refused, old, new):
    refused(PEDS.replace(old, new), "scales the ordinate", "export it again")


@pytest.mark.parametrize(
    ("ordinate", "signal", "first"),
    [("A", "T", 10**-0.855), ("%R", "R", 0.00855), ("R", "R", 0.855), ("T", "T", 0.855)],
)
def test_other_ordinates(write, ordinate, signal, first):
    text = PEDS.replace("%T", ordinate)
    for whole in ("83", "84", "85"):
        text = text.replace(f"\t{whole}.5", f"\t0.{whole}5")
    spectrum = read_spectrum(write(text))
    assert spectrum.signal == signal
    np.testing.assert_allclose(spectrum.values[0], first, rtol=1e-14)


def test_wavenumbers(write):
    text = PEDS.replace("#GR\nnm", "#GR\ncm-1").replace("PE UV", "PE IR")
    np.testing.assert_allclose(read_spectrum(write(text)).wavelength, 1e7 / np.array([800, 790, 780]))


def test_every_encoding(same_in_every_encoding):
    same_in_every_encoding(PEDS)


def test_decimal_commas(write):
    text = PEDS.replace(".5\n", ",5\n").replace(".000000\t", ",000000\t")
    np.testing.assert_allclose(read_spectrum(write(text)).values, [0.855, 0.845, 0.835])


def test_what_cannot_be_read(refused):
    refused(PEDS.replace("#GR\nnm", "#GR\npx"), "line 20", "'px'")
    refused(PEDS.replace("%T", "KM"), "KM", "neither a reflectance")
    refused(PEDS.partition("800.000000\t")[0], "no rows below #DATA")
    refused(PEDS.partition("#DATA")[0], "lacks the block")
    refused(PEDS.replace("\t84.5", ""), "line 32", "is empty")
    refused(PEDS, "contradicts", signal="R", error=UsageError)
    refused(PEDS, "contradicts", signal_unit="fraction", error=UsageError)


def test_fewer_points_than_stated(write):
    spectrum = read_spectrum(write(PEDS.partition("780.000000\t")[0]))
    assert "states 3 points but has 2: it may have been cut off" in spectrum.notes
