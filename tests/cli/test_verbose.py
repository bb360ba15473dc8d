"""`--verbose` tells on stderr what was understood and why; without it the library is silent."""

import re


def test_every_step_of_a_fit_is_told(pellicle, spectrum_file, scene):
    ran = pellicle("fit", spectrum_file(), *scene, "--verbose")
    sentences = re.findall(r"^ *\d+\.\d\d s  (.*)$", ran.err, re.MULTILINE)
    heads = [re.split(r":| of ", sentence)[0] for sentence in sentences if "oxide.csv" not in sentence]
    names = ("scene", "free", "data", "plan", "scan", "polished", "weights", "status", "time")
    assert tuple(dict.fromkeys(heads)) == names
    assert "oxide.csv: 100 rows used: R from 400 to 796 nm" in ran.err
    assert "scene: from air (exactly 1): index 1.46, 10 to 800 nm, on index 3.9 + 0.02i" in sentences
    assert "free: thickness between 10 and 800 nm" in sentences
    assert any("no noise is given" in sentence for sentence in sentences)
    # 790 nm in steps of at most 400 nm / 1.46 / 8
    assert any(s.startswith("scan: 25 values of thickness, 32.9 nm apart") for s in sentences)
    assert "status: converged" in sentences
    quiet = pellicle("fit", spectrum_file("again.csv"), *scene)
    assert quiet.code == ran.code == 0
    assert not re.search(r"^ *\d+\.\d\d s", quiet.err, re.MULTILINE)


def test_why_a_fit_is_no_answer(pellicle, spectrum_file):
    flags = ("--layer", "1.46", "--substrate", "3.9+0.02j", "--thickness", "10:250")
    ran = pellicle("fit", spectrum_file(), *flags, "-v")
    assert ran.code == 2  # there is no short form
    ran = pellicle("fit", spectrum_file(), *flags, "--noise", "0.002", "--verbose", code=4)
    assert "status: does the scene not explain the data? yes" in ran.err
    assert "its noise is given" in ran.err
