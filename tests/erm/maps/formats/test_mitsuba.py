"""Scenes for Sionna RT: its slabs reflect as the half-spaces of the map, and scatter what a rough face scatters."""

import numpy as np
import pytest
from scipy.constants import c, epsilon_0
from scipy.integrate import quad

import erm
from erm.common.errors import OptionError
from erm.maps.formats.mitsuba import constants
from erm.maps.materials import Material
from erm.maps.reflectors import make_reflectors
from erm.tracing.fresnel import fresnel, roughness_factor

COSINE = np.cos(np.radians([0, 30, 50, 70, 80]))


def slab(made: dict[str, float], frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """Reflection of a slab, both polarisations: ITU-R P.2040-3, Eq. 43."""
    eta = made["relative_permittivity"] - 1j * made["conductivity"] / (2 * np.pi * frequency * epsilon_0)
    q = 2 * np.pi * made["thickness"] * frequency / c * np.sqrt(eta - (1 - COSINE**2))
    back = np.exp(-2j * q)
    te, tm = ((r * (1 - back) / (1 - r**2 * back)) for r in fresnel(COSINE, np.full(COSINE.shape, eta)))
    return te, tm


@pytest.mark.parametrize("frequency", [3e9, 28e9, 132e9, 300e9])
@pytest.mark.parametrize("index", [1.6, 2.3, 3.0])
def test_a_measured_wall_reflects_as_a_half_space_whatever_the_thickness(frequency, index):
    seen = fresnel(COSINE, np.full(COSINE.shape, index**2 + 0j))
    for made, expected in zip(slab(constants(Material("wall", index + 0j), frequency), frequency), seen, strict=True):
        # 1e-3 comes back from the far side, and the loss that sees to it changes the index by 0.01
        np.testing.assert_allclose(np.abs(made), np.abs(expected), rtol=2e-3, atol=3e-3)


def test_what_is_scattered_is_not_lost_twice():
    seen, _ = fresnel(COSINE, np.full(COSINE.shape, 2.3**2 + 0j))
    made = constants(Material("wall", 2.3 + 0j), 132e9, 0.4)
    assert made["scattering_coefficient"] == 0.4
    specular = np.abs(slab(made, 132e9)[0]) * np.sqrt(1 - 0.4**2)
    assert specular[0] == pytest.approx(abs(seen[0]), rel=1e-3)
    np.testing.assert_allclose(20 * np.log10(specular / np.abs(seen)), 0, atol=0.7)  # at 80 degrees; 0.4 at 60
    with pytest.raises(OptionError, match=r"material wall: scattering 0\.95; .* expected less than 0\.92"):
        constants(Material("wall", 2.3 + 0j), 132e9, 0.95)


def test_a_rough_face_scatters_the_share_of_the_roughness_factor():
    frequency, deviation = 132e9, 0.15e-3
    kept, _ = quad(lambda u: roughness_factor(u, np.array(deviation), frequency) ** 2 * 2 * u, 0, 1)
    made = constants(Material("rough", 2 - 0.1j, height_deviation=deviation), frequency, 0.9)  # 0.9 is for others
    assert made["scattering_coefficient"] ** 2 == pytest.approx(1 - kept, rel=1e-9)
    assert constants(Material("smooth", 2 - 0.1j), frequency)["scattering_coefficient"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("scattering", [0.0, 0.4])
def test_sionna_rt_sees_the_paths_that_the_map_predicts(tmp_path, scattering):
    """Random walls of measured materials over a concrete ground, paths of up to two reflections."""
    rt = pytest.importorskip("sionna.rt", reason="Sionna RT cannot be used", exc_type=ImportError)
    rng = np.random.default_rng(5)
    indices = [1.7, 2.3, 2.9]
    own = {f"index {n}": Material(f"index {n}", n + 0j) for n in indices}
    ends = [[[-60, 12], [60, 12]], [[-60, -9], [20, -9]], [[70, -30], [70, 30]]]
    walls = make_reflectors(ends, top=40.0, material=list(own))
    street = erm.Environment(walls, erm.maps.environment.Slab(0.0, "concrete"), materials=own)
    erm.write_map(street, tmp_path / "street.xml", scattering=scattering)
    scene = rt.load_scene(str(tmp_path / "street.xml"))
    scene.frequency = 132e9
    scene.tx_array = scene.rx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
    tx = np.array([-5.0, 1.0, 8.0])
    scene.add(rt.Transmitter("tx", position=tx.tolist()))
    places = np.column_stack([rng.uniform(-40, 60, 4), rng.uniform(-7, 10, 4), rng.uniform(1, 3, 4)])
    for number, place in enumerate(places):
        scene.add(rt.Receiver(f"rx{number}", position=place.tolist()))
    found = rt.PathSolver()(scene, max_depth=2, samples_per_src=10**6, refraction=False, diffuse_reflection=False)
    gain = 20 * np.log10(np.maximum(np.hypot(*map(np.array, found.a)), 1e-12)).reshape(len(places), -1)
    delay = np.array(found.tau).reshape(len(places), -1)
    # 0.05 dB; where a face scatters, the ground loses 10 lg (1 - S^2) dB, and a measured wall up to 0.7 dB (above)
    bound = 0.05 if not scattering else -10 * np.log10(1 - scattering**2) + 2 * 0.7
    for place, gains, delays in zip(places, gain, delay, strict=True):
        expected = erm.predict(street, tx, place, 132e9)
        near = np.abs(delays - expected["delay"].values[:, None]) < 1e-11
        off = np.where(near, np.abs(gains - expected["path_gain"].values[:, None]), np.inf).min(axis=1)
        assert off.max() < bound, (place, off)
    if scattering:
        diffuse = rt.PathSolver()(scene, max_depth=1, samples_per_src=10**5, refraction=False, diffuse_reflection=True)
        assert np.array(diffuse.tau).size > 100 * len(places)
