"""A Gaussian lobe, written as a grid, is the Gaussian lobe read."""

import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.instrument.antenna_description import Antenna, Cut
from sounder.instrument.antenna_files import read_cut
from sounder.instrument.antenna_pattern import Pattern

AZIMUTH, ELEVATION = np.arange(-40.0, 41.0, 2.0), np.arange(-30.0, 31.0, 2.0)
LOBE = Antenna(gain=24.5, hpbw_azimuth=10.0, hpbw_elevation=9.0, sidelobe_floor=-60.0)


def level(azimuth, elevation):
    return -12 * ((azimuth / 10) ** 2 + (elevation / 9) ** 2) - 7.5  # to a peak of no meaning


def grid(separator):
    return "\n".join(separator.join((f"{a:g}", f"{e:g}", f"{level(a, e):.6f}")) for a in AZIMUTH for e in ELEVATION)


@pytest.mark.parametrize(
    "text",
    [
        "azimuth,elevation,gain\n" + grid(","),
        "NSI2000\nFar-field display\n\nAzimuth (deg)   Elevation (deg)   Amp(dB)\n" + grid("   "),
    ],
)
def test_a_gaussian_lobe_comes_back_from_a_grid(tmp_path, text):
    file = tmp_path / "horn.csv"
    file.write_text(text)
    antenna = LOBE.model_copy(update={"pattern": "cut", "cut": Cut(**read_cut(file))})
    looks = np.meshgrid(np.arange(-20.0, 21.0, 2.0), np.arange(-18.0, 19.0, 2.0))
    read, true = (Pattern.of(each).relative_gain(*looks) for each in (antenna, LOBE))
    np.testing.assert_allclose(read, true, atol=1e-5)
    # and when the antenna is tilted and turned
    toward = 33.0, 12.0, 30.0, 10.0
    read, true = (float(Pattern.of(each).beam_gain(*map(np.array, toward))) for each in (antenna, LOBE))
    # exact between points 2 degree apart, where lines would be 0.3 dB off; 0.002 dB is left by the table
    assert read == pytest.approx(true, abs=0.005)


def spherical(theta, phi):
    """Level of the lobe toward a direction at theta off boresight; phi 0 is left, phi 90 is up."""
    t, p = np.radians(theta), np.radians(phi)
    left, up = np.sin(t) * np.cos(p), np.sin(t) * np.sin(p)
    return level(np.degrees(np.arctan2(left, np.cos(t))), np.degrees(np.arcsin(up)))


def planet():
    cuts = [f"{name} 61\n" + "\n".join(f"{a % 360:g} {12 * (a / width) ** 2:.6f}" for a in np.arange(-30.0, 31.0))
            for name, width in (("HORIZONTAL", 10), ("VERTICAL", 9))]  # fmt: skip
    return "NAME a horn\nGAIN 22.35 dBd\n" + "\n".join(cuts) + "\n"


def far_field(header, row, phis=range(0, 360, 10), thetas=range(0, 31, 2)):
    return "\n".join([header, *(row(t, p, spherical(t, p) + 32) for p in phis for t in thetas)])


CST = "Theta [deg.]  Phi   [deg.]  Abs(Gain)[dBi   ]   Phase(Theta)[deg.]\n" + 60 * "-"
HFSS = '"Phi [deg]","Theta [deg]","dB(GainTotal) []"'


@pytest.mark.parametrize(
    "text",
    [
        planet(),
        far_field(CST, lambda t, p, g: f"{t:9.3f} {p:9.3f} {g:14.7e} {0:8.3f}"),
        far_field(HFSS, lambda t, p, g: f"{p},{t},{g:.7g}"),
        far_field(HFSS, lambda t, p, g: f"{p},{t},{g:.7g}", phis=range(0, 361, 30)),
        far_field(HFSS, lambda t, p, g: f"{p},{t},{g:.7g}", phis=range(0, 180, 10), thetas=range(-30, 31, 2)),
        "Azimuth;Elevation;Loss (dB)\n"
        + "\n".join(f"{a % 360:g};{e:g};{-level(a, e):.6f}".replace(".", ",") for a in AZIMUTH for e in ELEVATION),
        "\ufeffElevation,Angle,Azimuth\n"
        + "\n".join(f"{level(0, a):.6f},{a % 360:g},{level(a, 0):.6f}" for a in ELEVATION),
    ],
)
def test_every_format_gives_the_lobe_that_was_written(tmp_path, text):
    file = tmp_path / "horn.txt"
    file.write_text(text, encoding="utf-8")
    cut = Cut(**read_cut(file))
    antenna = Antenna(**LOBE.model_dump(exclude={"pattern", "cut"}), pattern="cut", cut=cut)
    looks = np.meshgrid(np.arange(-20.0, 21.0, 2.0), np.arange(-18.0, 19.0, 2.0))
    np.testing.assert_allclose(*(Pattern.of(each).relative_gain(*looks) for each in (antenna, LOBE)), atol=1e-4)
    if cut.gain is not None:
        assert cut.gain == pytest.approx(24.5)
        with pytest.raises(ValueError, match=r"gain is 20 dBi, but the file of the cut states 24.5 dBi"):
            Antenna(**LOBE.model_dump(exclude={"pattern", "cut", "gain"}), gain=20, pattern="cut", cut=cut)


def test_angles_of_a_cut_are_signed_one_by_one(tmp_path):
    file = tmp_path / "horn.csv"
    angle = np.arange(360)
    left = np.where(angle < 180, -0.2, -0.1) * np.minimum(angle, 360 - angle)
    file.write_text("angle,azimuth,elevation\n" + "\n".join(f"{a},{g},{g}" for a, g in zip(angle, left, strict=True)))
    cut = read_cut(file)
    assert cut["angle"][0], cut["angle"][-1] == (-179, 180)
    assert [cut["azimuth"][cut["angle"].index(a)] for a in (-30, 0, 30)] == pytest.approx([-3, 0, -6])


ANGLE = np.arange(-180.0, 181.0, 5.0)
GAIN = np.maximum(-12 * (ANGLE / 10) ** 2, -40.0)


@pytest.mark.parametrize(
    ("cut", "what"),
    [
        (-GAIN, "maximum at -180"),  # loss for gain
        (10 ** (GAIN / 10), "inf degree wide"),  # linear power for dB
        (np.roll(GAIN, 18), "maximum at 90"),  # boresight at 90, as of zenith angles
    ],
)
def test_a_cut_that_is_not_gain_off_boresight_is_refused(cut, what):
    def cuts(azimuth, elevation):
        return {"angle": tuple(ANGLE), "azimuth": tuple(azimuth), "elevation": tuple(elevation)}

    widths = {"hpbw_azimuth": 10.0, "hpbw_elevation": 10.0}
    Antenna(gain=20, pattern="cut", cut=cuts(GAIN, GAIN), **widths)
    for name, pair in (("azimuth", (cut, GAIN)), ("elevation", (GAIN, cut))):
        with pytest.raises(ValueError, match=f"the cut in {name} .*{what}"):
            Antenna(gain=20, pattern="cut", cut=cuts(*pair), **widths)


def test_a_grid_with_holes_is_refused(tmp_path):
    file = tmp_path / "horn.csv"
    file.write_text("azimuth,elevation,gain\n-1,0,-1\n0,0,0\n1,0,-1\n0,1,-1\n")
    with pytest.raises(DataError, match="4 directions of 3 and 2 angles; expected a full grid"):
        read_cut(file)
