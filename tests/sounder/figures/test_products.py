"""Figures of a DAPS: contents, places and units; unusual products can be drawn, too."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_hex
from matplotlib.projections.polar import PolarAxes

from erm.common import console
from sounder.figures import products

STEP = 1 / 1.2e9
COMBINED = "strongest of elevations -9, 0, 9°"


def product(paths=((150.0, 60.0, -100.0), (300.0, 240.0, -120.0)), *, azimuth=None, samples=1022) -> xr.Dataset:
    """DAPS of paths (delay [ns], azimuth [degree], gain [dB]) over noise of -150 dB; a path fills one beam."""
    azimuth = np.arange(0.0, 360, 10) if azimuth is None else np.asarray(azimuth)
    power = np.full((azimuth.size, 3, samples), -150.0)
    delay = np.arange(samples) * STEP
    for nanoseconds, toward, gain in paths:
        power[np.argmin(np.abs(azimuth - toward)), 1, round(nanoseconds * 1e-9 / STEP)] = gain
    grid = ("azimuth", "elevation")
    return xr.Dataset(
        {
            "daps": ((*grid, "delay"), power),
            "noise_floor": (grid, np.full((azimuth.size, 3), -150.0)),
            "pdp": ("delay", power.max((0, 1)), {"long_name": "omnidirectional power delay profile: sum of the beams"}),
        },
        coords={"azimuth": azimuth, "elevation": [-9.0, 0.0, 9.0], "delay": delay},
    )


def table(azimuth) -> xr.Dataset:
    azimuth = np.asarray(azimuth, float)
    return xr.Dataset(
        {
            "delay": ("mpc", np.linspace(100e-9, 300e-9, azimuth.size)),
            "azimuth": ("mpc", azimuth),
            "azimuth_std": ("mpc", np.full(azimuth.size, np.nan)),
            "path_gain": ("mpc", np.linspace(-100.0, -120.0, azimuth.size)),
            "path_gain_std": ("mpc", np.full(azimuth.size, np.nan)),
        }
    )


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture
def polar() -> PolarAxes:
    axes = plt.figure().add_subplot(projection="polar")
    assert isinstance(axes, PolarAxes)
    return axes


def bars(axes) -> list[tuple[float, float, str]]:
    """Range and label of every colour bar."""
    others = [ax for ax in axes.figure.axes if ax is not axes]
    return [(*sorted(ax.get_ylim()), ax.get_ylabel()) for ax in others]


def test_cartesian_has_units_and_all_mpcs():
    axes = products.daps_cartesian(product(), plt.figure().add_subplot(), mpc=table([60, 240, 357]))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Delay (ns)", "Azimuth of arrival (°)")
    assert axes.get_legend().get_texts()[0].get_text() == "MPCs (3)"
    markers = axes.lines[0]
    # 357 degrees belongs into the row of 0, which reaches from -5 to 5
    assert markers.get_ydata().tolist() == [60, 240, -3]
    assert markers.get_xdata() == pytest.approx([100, 200, 300])
    assert axes.get_ylim() == (-5, 355)
    ((low, high, label),) = bars(axes)
    assert label == f"Path gain incl. RX antenna (dB)\n{COMBINED}"
    assert (low, high) == (-140, -100)
    # the last path stands at 300 ns; a tenth to spare
    assert axes.get_xlim() == pytest.approx((0, 330), abs=1)


@pytest.mark.slow
def test_a_legend_hides_nothing():
    figure = plt.figure(layout="constrained")
    axes = products.daps_cartesian(product(), figure.add_subplot(), mpc=table([60]))
    curves = products.pdp([("RX1", product()), ("RX2", product())], plt.figure(layout="constrained").add_subplot())
    for drawn in (axes, curves):
        drawn.figure.canvas.draw()
        assert not drawn.get_legend().get_window_extent().overlaps(drawn.get_window_extent().shrunk(0.99, 0.99))


def test_polar_shows_a_path_where_it_came_from(polar):
    axes = products.daps_polar([("RX1", product())], polar)
    sectors = axes.collections[0]
    assert sectors.get_array().max() == -100
    corners = np.array([path.vertices[:-1] for path in sectors.get_paths()])  # the last closes the path
    middle = np.degrees(corners[..., 0].mean(axis=1))
    assert sorted(set(np.round(middle, 6))) == [60, 240]
    assert np.ptp(corners[..., 0], axis=1) == pytest.approx(np.full(len(corners), np.radians(10)))
    # rings are a hundredth of the radius or a sample
    at = corners[..., 1].min(axis=1)
    assert sorted(np.unique(at)) == pytest.approx([150, 300], abs=330 / products.RINGS + 1)
    assert axes.get_xlabel() == "Angle: azimuth of arrival; radius: delay (ns)"
    # the bar spans what is drawn, not what could be
    ((low, high, label),) = bars(axes)
    assert (low, high) == (-120, -100)
    assert label == f"RX1: path gain incl. RX antenna (dB)\n{COMBINED}"


def test_what_is_weak_is_left_blank(polar):
    # 11 dB over the noise; and 41 dB under the strongest
    shown = product(((150.0, 60.0, -95.0), (200.0, 90.0, -139.0), (250.0, 120.0, -136.5)))
    mesh = products.daps_polar([("RX1", shown)], polar).collections[0]
    assert np.unique(mesh.get_array().compressed()).tolist() == [-95]


def test_two_positions_share_the_diagram_in_colours_of_their_own(polar):
    second = product(((500.0, 120.0, -90.0), (600.0, 130.0, -100.0)))
    axes = products.daps_polar([("RX1", product()), ("RX2", second)], polar)
    first, other = axes.collections[:2]
    assert first.get_cmap() != other.get_cmap()
    assert {label for *_, label in bars(axes)} == {
        f"RX{i}: path gain incl. RX antenna (dB)\n{COMBINED}" for i in (1, 2)
    }
    assert axes.get_rmax() == pytest.approx(660, abs=1)  # the longer of both
    for mesh in (first, other):  # the palest colour shown is darker than the page by a fifth in one channel at least
        palest = to_hex(mesh.get_cmap()(0.0))
        assert min(int(palest[i : i + 2], 16) for i in (1, 3, 5)) < 0.8 * 255
    with pytest.raises(ValueError, match="3 positions; expected one or two"):
        products.daps_polar([("x", second)] * 3, polar)


def test_labels_of_the_radius_are_where_least_is_drawn(polar):
    everywhere = [(200.0, a, -100.0) for a in range(0, 360, 10) if not 190 <= a <= 230]
    axes = products.daps_polar([("RX1", product(everywhere))], polar)
    assert axes.get_rlabel_position() == 195  # the first of the spokes' gaps inside 190 to 230


def test_a_gap_of_the_scan_stays_empty(polar):
    axes = products.daps_polar([("RX1", product(((100.0, 20.0, -90.0),), azimuth=[0, 10, 20, 60, 70]))], polar)
    corners = np.degrees(np.concatenate([path.vertices[:, 0] for path in axes.collections[0].get_paths()]))
    assert corners.min() == pytest.approx(15)
    assert corners.max() == pytest.approx(25)


@pytest.mark.parametrize("azimuth", [None, [40.0], [-170.0, -50.0, 80.0]])
@pytest.mark.slow
def test_missing_directions_noise_alone_and_odd_scans_can_be_drawn(polar, azimuth):
    daps = product((), azimuth=azimuth)
    daps["daps"][0] = np.nan
    daps["noise_floor"][0] = np.nan
    if daps.sizes["azimuth"] > 1:
        products.daps_cartesian(daps, plt.figure().add_subplot(), mpc=table([]))
    products.daps_polar([("RX1", daps)], polar)
    products.pdp([("RX1", daps)], plt.figure().add_subplot())
    for number in plt.get_fignums():
        plt.figure(number).canvas.draw()


def test_a_pdp_with_mpcs_has_their_threshold_over_the_noise_floor():
    mpc = table([60.0, 240.0])
    axes = products.pdp([("RX1", product())], plt.figure().add_subplot(), mpc=mpc.assign_attrs(threshold="usc"))
    lines = {line.get_label(): line for line in axes.lines}
    assert lines["threshold"].get_ydata()[0] == -138.0
    assert lines["noise floor"].get_ydata()[0] == -150.0
    (marks,) = axes.containers
    assert marks.lines[0].get_ydata().tolist() == [-100.0, -120.0]


def test_pdp_has_units_and_a_line_each():
    axes = products.pdp([("RX1", product()), ("RX2", product())], plt.figure().add_subplot())
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Delay (ns)", "Path gain (dB)\nsum of the beams")
    assert axes.get_ylim()[0] == -150 - products.PDP_MARGIN
    assert [line.get_label() for line in axes.lines] == ["RX1", "RX2"]
    peak = axes.lines[0]
    assert peak.get_xdata()[np.argmax(peak.get_ydata())] == pytest.approx(150, abs=STEP * 1e9)


@pytest.mark.slow
def test_text_is_readable_in_a_column(tmp_path, monkeypatch):
    # A column is 3.5 inches wide; text of 6 points there is what IEEE asks for at least.
    from sounder.figures import files

    drawn = {}
    save = files.save_figure
    monkeypatch.setattr(files, "_groups", lambda path, *others: (path.stem, product(), *[table([60]) for _ in others]))
    monkeypatch.setattr(files, "save_figure", lambda axes, path: (drawn.update({path: axes}), save(axes, path)))
    files.draw_product(tmp_path / "the-corner-of-the-old-market.h5", tmp_path)
    assert len(drawn) == 3
    for path, axes in drawn.items():
        picture = plt.imread(path)
        shrunk = 3.5 / (picture.shape[1] / 160)  # 160 points an inch
        texts = [
            axes.xaxis.label,
            *axes.get_xticklabels(),
            *(t for ax in axes.figure.axes[1:] for t in [ax.yaxis.label]),
        ]
        assert min(text.get_fontsize() for text in texts) * shrunk >= 6
        edge = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
        assert (edge == 1).all()  # white: nothing is cut


@pytest.mark.slow
def test_axes_that_are_drawn_into_again_give_the_figures_of_new_ones(tmp_path, monkeypatch):
    from sounder.figures import files

    of = {"weak": (product(((150.0, 60.0, -139.0),)), table([])), "plain": (product(), table([60, 240]))}
    monkeypatch.setattr(files, "_groups", lambda path, *_: (path.stem, *of[path.stem]))
    monkeypatch.setattr(console, "DPI", 40)
    axes = files.product_axes()
    for name in of:
        files.draw_product(tmp_path / f"{name}.h5", tmp_path / "again", axes=axes)
        bar = axes[0].figure.axes[1]
        assert bar.get_visible() == (name == "plain")  # nothing is shown of what is weak
    for new in files.draw_product(tmp_path / "plain.h5", tmp_path / "new"):
        assert (tmp_path / "again" / new.name).read_bytes() == new.read_bytes(), new.name


def test_a_daps_says_which_elevations_it_shows():
    figure = plt.figure()
    products.daps_cartesian(product(), figure.add_subplot(121))
    alone = products.daps_cartesian(product(), figure.add_subplot(122), elevation=9.0)
    labels = [axes.get_ylabel().splitlines()[-1] for axes in figure.axes if "Path gain" in axes.get_ylabel()]
    assert labels == [COMBINED, "elevation 9°"]
    # the paths are at elevation 0: at 9 there is noise alone, on the scale of all
    image = alone.images[0]
    assert (image.get_array().max(), image.get_clim()[1]) == (-150.0, -100.0)
