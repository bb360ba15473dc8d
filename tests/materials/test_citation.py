"""References from HTML to text."""

from pellicle.materials.page import plain_text, short_citation

REFERENCE = (
    'P. B. Johnson and R. W. Christy.\nOptical constants of the noble metals.\n<a href="https://doi.org/10.1/x">'
    "<i>Phys. Rev. B</i> <b>6</b>, 4370&ndash;4379 (1972)</a><br>\n"
    '[<a href="https://a.b/c">Calculation script</a>]'
)


def test_tags_go_and_dois_stay():
    assert plain_text(REFERENCE) == (
        "P. B. Johnson and R. W. Christy. Optical constants of the noble metals. "
        "Phys. Rev. B 6, 4370–4379 (1972) https://doi.org/10.1/x"
    )


def test_other_links_leave_their_text():
    assert plain_text('<a href="https://a.b/c">data sheet</a>, 2017') == "data sheet, 2017"


def test_orientations_are_no_tags():
    assert plain_text("Orientation: <111>; H<sub>2</sub>O") == "Orientation: <111>; H2O"


def test_nothing():
    assert plain_text(None) == ""
    assert short_citation(None) == ""


def test_first_author_and_year():
    assert short_citation(REFERENCE) == "Johnson et al. 1972"
    assert short_citation("M. J. Dodge.\nMgF2.\nAppl. Opt. 23, 1980-1985 (1984)") == "Dodge 1984"
    assert short_citation("1) A. D. Rakić.\nX 12 (1995)") == "Rakić 1995"
    assert short_citation("L. V. Rodríguez-de Marcos, J. A. B. (2017)") == "Rodríguez-de Marcos 2017"
    assert short_citation("Some catalog") == "Some catalog"
