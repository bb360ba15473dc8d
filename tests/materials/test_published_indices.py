"""Each page added for its name against a value that others published.

A value of the same page would prove nothing: where no handbook has one, it is another author's measurement of
the material, and the tolerance is then what such measurements differ by.
"""

import numpy as np
import pytest

from pellicle.materials import material

# page, wavelength (nm), n + ik, tolerance, source
PUBLISHED = [
    # the first pages, by the papers and data sheets
    ("SiO2", 587.5618, 1.45846, 5e-6, "Malitson 1965"),
    ("BK7", 587.5618, 1.51680 + 9.75e-9j, 5e-6, "SCHOTT data sheet"),
    ("Si", 550.0, 4.077 + 0.02797j, 1e-3, "Green 2008, table 1: n 4.077, α 6.39e3 /cm"),
    ("Au", 616.8, 0.21 + 3.272j, 1e-9, "Johnson and Christy 1972, table I, 2.01 eV"),
    ("water", 550.0, 1.333 + 1.96e-9j, 1e-9, "Hale and Querry 1973, table I"),
    ("sapphire", 587.6, 1.7682, 1e-4, "Malitson 1962"),
    ("HgS/Bond-o", 620.0, 2.9028, 3e-3, "Bond 1967, measured; Bhar's formula is a fit to it"),
    # crystals and glasses: handbooks of minerals and gems, data sheets of the makers
    ("quartz", 589.3, 1.54424, 1e-4, "CRC Handbook, quartz n_o"),
    ("SiO2/Ghosh-e", 589.3, 1.55335, 1e-4, "CRC Handbook, quartz n_e"),
    ("calcite", 589.3, 1.65835, 1e-4, "CRC Handbook, calcite n_o"),
    ("CaCO3/Ghosh-e", 589.3, 1.48640, 4e-4, "CRC Handbook, calcite n_e"),
    ("sapphire-e", 589.3, 1.760, 5e-4, "CRC Handbook, corundum n_e"),
    ("rutile-e", 589.3, 2.903, 6e-3, "CRC Handbook, rutile n_e; Cronemeyer 1952: 2.90"),
    ("MgF2-e", 589.3, 1.390, 5e-4, "CRC Handbook, sellaite n_e"),
    ("diamond", 589.3, 2.4173, 2e-3, "CRC Handbook"),
    ("NaCl", 589.3, 1.54427, 3e-4, "CRC Handbook, halite"),
    ("KBr", 589.3, 1.5598, 3e-4, "CRC Handbook"),
    ("CaF2", 589.3, 1.4338, 1e-4, "CRC Handbook, fluorite"),
    ("BaF2", 589.3, 1.4744, 2e-4, "Crystran data sheet"),
    ("LiF", 589.3, 1.3921, 3e-4, "CRC Handbook"),
    ("MgO", 589.3, 1.7366, 1e-3, "CRC Handbook, periclase"),
    ("spinel", 589.3, 1.718, 3e-3, "Webster, Gems"),
    ("SrTiO3", 589.3, 2.409, 3e-3, "Webster, Gems, fabulite"),
    ("YAG", 589.3, 1.833, 1e-3, "Webster, Gems"),
    ("ZrO2", 589.3, 2.165, 1e-2, "Webster, Gems, cubic zirconia 2.15 to 2.18"),
    ("LiNbO3", 632.8, 2.2863, 1e-3, "Nelson and Mikulyak 1974, congruent, n_o"),
    ("LiNbO3/Zelmon-e", 632.8, 2.2022, 1e-3, "Nelson and Mikulyak 1974, congruent, n_e"),
    ("BaTiO3", 632.8, 2.416, 1.5e-2, "Johnston 1971, unclamped"),
    ("BaTiO3-e", 589.3, 2.382, 1e-2, "Johnston 1971 less the birefringence of 0.055, Merz 1949"),
    ("GeO2", 589.3, 1.607, 2e-3, "CRC Handbook, glass"),
    ("borofloat", 587.6, 1.4714, 2e-4, "SCHOTT data sheet, n_d"),
    ("D263", 587.6, 1.5230, 4e-4, "SCHOTT data sheet, n_d 1.5230 to 1.5233"),
    ("EagleXG", 589.3, 1.5099, 2e-4, "Corning data sheet"),
    ("SF11", 587.6, 1.78472, 2e-5, "SCHOTT data sheet, n_d"),
    ("SiC", 589.3, 2.647, 2e-3, "Singh et al. 1971, hexagonal, n_o"),
    ("SiC/Wang-4H-e", 589.3, 2.693, 1e-2, "Singh et al. 1971, hexagonal, n_e"),
    # semiconductors
    ("Ge", 632.8, 5.469 + 0.710j, 0.05, "Jellison 1992"),
    ("Ge/Aspnes", 632.8, 5.469 + 0.710j, 0.12, "Jellison 1992"),
    ("GaAs", 632.8, 3.847 + 0.189j, 0.02, "Jellison 1992"),
    ("GaAs/Papatryfonos", 632.8, 3.847 + 0.189j, 0.04, "Jellison 1992"),
    ("InP", 632.8, 3.334 + 0.305j, 0.25, "Adachi 1989, a model of the bands"),
    ("GaP", 632.8, 3.315, 0.01, "Bond 1965"),
    ("InAs", 632.8, 3.897 + 0.603j, 0.08, "Adachi 1989, a model of the bands"),
    ("GaSb", 632.8, 5.135 + 1.24j, 0.12, "Ferrini et al. 1998"),
    ("InSb", 632.8, 4.214 + 1.81j, 0.1, "Djurišić et al. 2000, a fit to several sources"),
    ("AlAs", 632.8, 3.110, 0.03, "Fern and Onton 1971"),
    ("AlN", 632.8, 2.048, 0.12, "Beliaev et al. 2021, sputtered film"),
    ("GaN", 632.8, 2.378, 0.01, "Lin et al. 1993, wurtzite"),
    ("CdTe", 632.8, 3.014 + 0.332j, 0.1, "Adachi et al. 1993"),
    ("ZnSe", 632.8, 2.591, 0.02, "Connolly et al. 1979"),
    ("ZnSe/Connolly", 632.8, 2.578, 0.02, "Marple 1964"),
    ("ZnTe", 632.8, 2.989, 2e-3, "Marple 1964"),
    ("a-Si", 632.8, 4.516 + 0.236j, 0.4, "SOPRA, amorphous silicon 2"),
    ("a-Si:H", 632.8, 4.516 + 0.236j, 0.4, "SOPRA, amorphous silicon 2"),
    # oxides and nitrides as films
    ("Ta2O5", 550, 2.16, 0.02, "Macleod, Thin-Film Optical Filters"),
    ("Nb2O5", 632.8, 2.326, 0.01, "Franta et al. 2024, sputtered film"),
    ("TiN", 632.8, 0.82 + 2.35j, 0.7, "Schnabel et al. 2018, sputtered film"),
    # metals: Palik's handbook; evaporated films and solids differ
    ("Pt", 632.8, 2.327 + 4.149j, 0.05, "Palik"),
    ("Ni", 632.8, 1.958 + 3.718j, 0.4, "Palik"),
    ("Pd", 632.8, 1.82 + 4.20j, 0.12, "Rakić et al. 1998"),
    ("W", 632.8, 3.638 + 2.917j, 0.15, "Palik"),
    ("Co", 632.8, 2.817 + 4.31j, 0.65, "SOPRA, cobalt, first sample"),
    ("V", 632.8, 3.528 + 2.951j, 0.15, "SOPRA"),
    ("Mn", 632.8, 2.348 + 3.54j, 0.2, "Querry 1987"),
    ("Mo", 632.8, 3.426 + 3.63j, 0.3, "Kirillova et al. 1971"),
    ("Ta", 589.3, 1.93 + 2.15j, 0.4, "Werner et al. 2009, calculated"),
    ("Ir", 632.8, 2.530 + 4.613j, 0.6, "Palik"),
    ("Rh", 589.3, 2.0 + 5.42j, 0.15, "Coulter et al. 1973, deposited at 300 °C"),
    ("Nb", 632.8, 2.274 + 3.28j, 0.8, "Golovashkin et al. 1969"),
    ("Hg", 589.3, 1.73 + 4.96j, 0.05, "Drude 1890"),
    ("stainless-steel", 632.8, 2.149 + 3.43j, 0.75, "Karlsson and Ribbing 1982, ferritic steel"),
    # polymers and liquids
    ("PMMA", 589.3, 1.491, 2e-3, "Polymer Handbook, 1.489 to 1.493"),
    ("polystyrene", 589.3, 1.591, 1e-3, "Polymer Handbook, 1.59 to 1.592"),
    ("polycarbonate", 589.3, 1.585, 1e-3, "Polymer Handbook"),
    ("PET", 589.3, 1.575, 8e-3, "Polymer Handbook"),
    ("cellulose", 587.6, 1.470, 5e-4, "Kasarova et al. 2007, measured"),
    ("PVA", 589.3, 1.479, 8e-3, "Schnepf et al. 2017"),
    ("PDMS", 589.3, 1.412, 1e-3, "Dow data sheet of Sylgard 184"),
    ("SU-8", 632.8, 1.587, 0.02, "MicroChem data sheet of SU-8 2000"),
    ("ethanol", 589.3, 1.3611, 1e-3, "CRC Handbook, 20 °C"),
    ("methanol", 589.3, 1.3288, 1.5e-3, "CRC Handbook, 20 °C"),
    ("isopropanol", 589.3, 1.3776, 1.5e-3, "CRC Handbook, 20 °C"),
    ("acetone", 589.3, 1.3588, 1.5e-3, "CRC Handbook, 20 °C"),
    ("glycerol", 589.3, 1.4746, 4e-3, "CRC Handbook, 20 °C"),
    ("toluene", 589.3, 1.4961, 1.5e-3, "CRC Handbook, 20 °C"),
]


@pytest.mark.parametrize(
    ("name", "nm", "expected", "tolerance", "source"), PUBLISHED, ids=[row[0] for row in PUBLISHED]
)
def test_an_index_agrees_with_a_published_one(name, nm, expected, tolerance, source):
    assert abs(complex(material(name)(nm)) - expected) < tolerance, source


def test_galena_reflects_as_the_mineral():
    """42.1 % at 589 nm in air: Criddle and Stanley, Quantitative Data File for Ore Minerals."""
    n = complex(material("PbS")(589.0))
    assert abs((n - 1) / (n + 1)) ** 2 == pytest.approx(0.421, abs=0.015)


@pytest.mark.parametrize("name", ["GaAs", "Ta2O5", "PMMA", "ethanol", "Ge"])
def test_a_name_gives_its_range_source_and_reason(name):
    source = material(name)
    low, high = source.wavelength_range
    assert low < 633 < high
    assert "doi.org" in source.citation
    assert len(source.note.split()) > 3
    assert np.isfinite(complex(source(633.0)))
