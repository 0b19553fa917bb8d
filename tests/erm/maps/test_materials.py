"""Materials: numbers of the Recommendation, the letter's plaster, and what cannot exist."""

import numpy as np
import pytest
from scipy.constants import epsilon_0

from erm.common.errors import DataError
from erm.maps.materials import LIBRARY, Material
from erm.tracing.fresnel import roughness_factor


def conductivity(material: Material, frequency: float) -> float:
    return -material.relative_permittivity(frequency).imag * 2 * np.pi * frequency * epsilon_0


@pytest.mark.parametrize(
    ("name", "real", "sigma"),
    # another implementation of ITU-R P.2040 at 132 GHz, to the digits it prints
    [
        ("concrete", 5.17, 2.9703),
        ("brick", 4.15, 1.2882),
        ("glass", 6.5767, 1.5696),
        ("marble", 7.94, 0.4731),
        ("wood", 1.82, 0.7656),
    ],
)
def test_building_materials_at_132_ghz_are_those_of_the_recommendation(name, real, sigma):
    material = LIBRARY[name]
    assert material.relative_permittivity(132e9).real == pytest.approx(real, abs=5e-5)
    assert conductivity(material, 132e9) == pytest.approx(sigma, abs=5e-5)


def test_the_plaster_of_the_letter_conducts_3_8_siemens_at_300_ghz():
    plaster = LIBRARY["plaster"]
    assert plaster.relative_permittivity(300e9) == pytest.approx(3.682919 - 0.22656j, abs=1e-9)
    assert conductivity(plaster, 300e9) == pytest.approx(3.7812, abs=5e-5)


def test_the_roughness_of_the_letter_makes_sense_in_millimetres_and_swapped_alone():
    normal, oblique, grazing = np.cos(np.radians([0.0, 60.0, 80.0]))

    def decibel(cosine: float, deviation: float) -> float:
        return 20 * np.log10(roughness_factor(np.array(cosine), np.array(deviation), 299.792458e9))

    # lambda is 1 mm: 20 log10(exp(-(4 pi 0.15)^2 / 2)) = -15.43, a quarter of it at 60 degrees
    plaster = LIBRARY["plaster"]
    assert decibel(normal, plaster.height_deviation) == pytest.approx(-15.43, abs=0.005)
    assert decibel(oblique, plaster.height_deviation) == pytest.approx(-3.86, abs=0.005)
    # as printed no wall would reflect at any angle
    assert decibel(normal, 1.7e-3) < -1900
    assert decibel(grazing, 1.7e-3) < -59


@pytest.mark.parametrize("name", LIBRARY)
def test_no_material_amplifies(name):
    for frequency in (100e9, 132e9, 300e9):
        permittivity = LIBRARY[name].relative_permittivity(frequency)
        assert permittivity.real >= 1
        assert permittivity.imag <= 0


@pytest.mark.parametrize("name", LIBRARY)
def test_a_material_survives_json(name):
    material = LIBRARY[name]
    assert repr(Material.from_dict(material.to_dict())) == repr(material)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"name": "gain", "refractive_index": [1.5, 0.1]}, "a loss is negative"),
        ({"name": "dense", "refractive_index": [1e200, 0.0]}, "both finite"),
        ({"name": "nothing", "permittivity": [0, 0]}, "must be positive"),
        ({"name": "bumpy", "height_deviation": -1e-3}, "height deviation"),
        ({"name": "odd", "colour": "red"}, "colour"),
        ({"name": "odd", "permittivity": 3}, "odd"),
        ({"permittivity": [3, 0]}, "name"),
        ({"name": [1.5, 0.0]}, "name is .1.5, 0.0.; expected a text"),
    ],
)
def test_impossible_materials_are_refused_by_name(values, complaint):
    with pytest.raises(DataError, match=complaint):
        Material.from_dict(values)
