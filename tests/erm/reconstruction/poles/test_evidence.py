"""Evidence for a wall: gains weighted by their errors, more paths than by chance, no corner behind it."""

import numpy as np
import pytest
from scipy.constants import c

from erm.geometry.vertical import azimuth_of, mirrored
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import select
from erm.mpcs.standard_errors import widen_errors
from erm.mpcs.table import make_table
from erm.reconstruction.decision.corners import corner_pairs
from erm.reconstruction.decision.decide import KnownCurved, decide_walls
from erm.reconstruction.decision.pieces import Links
from erm.reconstruction.model.extent import Legs
from erm.reconstruction.model.fit import fit_line
from erm.reconstruction.model.line import seed_line
from erm.reconstruction.model.loss import loss_at_normal_incidence, loss_error, reflection_loss, weighted_quantile
from erm.reconstruction.model.paths import Paths
from erm.reconstruction.model.wall import Wall, cos_incidence
from erm.reconstruction.reconstruct import reconstruct
from erm.reconstruction.search.consensus import find_groups

FREQUENCY = 132e9
TX = np.array([0.0, 0.0, 28.0])
SOUTH, EAST = (90.0, -30.0), (180.0, -60.0)  # normal [degree], offset [m]: y = -30 and x = 60


def receivers(count, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(5, 50, count), rng.uniform(-25, 15, count), np.full(count, 1.4)])


def paths(rx, *chain, loss=6.0, loss_std=0.5):
    """Exact paths off successive walls; the loss may differ between paths."""
    count = len(rx)
    image = TX[:2]
    for normal, offset in chain:
        image = mirrored(image, normal, offset)
    seen = image - rx[:, :2]
    one = np.ones(count)
    return Paths(
        tx=np.tile(TX, (count, 1)),
        rx=rx,
        length=np.hypot(np.linalg.norm(seen, axis=-1), TX[2] - rx[:, 2]),
        azimuth=azimuth_of(seen),
        length_std=0.01 * one,
        azimuth_std=0.3 * one,
        link=np.arange(count),
        transmitter=np.zeros(count, dtype=np.int64),
        loss=loss * one,
        loss_std=loss_std * one,
        wavelength=c / FREQUENCY * one,
        elevation_excess=np.nan * one,
        elevation_std=np.nan * one,
        row=np.arange(count),
        scatter=np.zeros((count, 2)),
        clutter=1e-4 * one,
    )


def wall(inliers):
    start = seed_line(inliers.take(np.array([0])))
    return Wall(inliers, fit_line(inliers, start), np.arange(len(inliers)))


def table(*parts):
    """MPC table of sets of paths."""
    columns = {
        "position": np.concatenate([np.array([f"RX{x:.6f}" for x in part.rx[:, 0]]) for part in parts]),
        "tx_position": np.concatenate([part.tx for part in parts]),
        "rx_position": np.concatenate([part.rx for part in parts]),
        "delay": np.concatenate([part.length for part in parts]) / c,
        "azimuth": np.concatenate([part.azimuth for part in parts]),
        "delay_std": np.concatenate([part.length_std for part in parts]) / c,
        "azimuth_std": np.concatenate([part.azimuth_std for part in parts]),
        "path_gain_std": np.concatenate([part.loss_std for part in parts]),
    }
    length, loss = columns["delay"] * c, np.concatenate([part.loss for part in parts])
    columns["path_gain"] = 20 * np.log10(c / FREQUENCY / (4 * np.pi * length)) - loss
    return make_table(columns | {"frequency": FREQUENCY})


def test_uncertain_gains_do_not_make_a_wall_lossy():
    rx = receivers(7)
    good = paths(rx, SOUTH)
    cosine = cos_incidence(good, fit_line(good, seed_line(good.take(np.array([0])))).frame())
    true = reflection_loss(4.0, cosine)
    # five of seven are beyond the elevations of the scan, measured 12 dB too weak
    error = np.where(np.arange(7) < 5, 15.0, 0.5)
    wrong = wall(paths(rx, SOUTH, loss=true + np.where(error > 1, 12.0, 0.0), loss_std=error))
    at_normal = float(reflection_loss(4.0, np.ones(1))[0])
    assert loss_at_normal_incidence(wrong) == pytest.approx(at_normal, abs=1.0)
    # the weights 1 / (15**2 + 3**2) and 1 / (0.5**2 + 3**2) leave 10 % to the five
    assert 0.5 < loss_error(wrong) < 3.0
    uncertain = wall(paths(rx, SOUTH, loss=true + 12.0, loss_std=15.0))
    assert loss_error(uncertain) == pytest.approx(15.0)


@pytest.mark.parametrize(("loss_std", "found"), [(0.5, False), (12.0, True)])
def test_a_lossy_wall_is_accepted_only_if_its_gains_are_uncertain(loss_std, found):
    near = paths(receivers(10), EAST)
    far = paths(receivers(10, seed=1)[:5], SOUTH, loss=25.0, loss_std=loss_std)
    environment, _ = reconstruct(select(table(near, far)), max_gap=np.inf)
    offsets = environment.reflectors["offset"].values
    assert bool(np.any(np.abs(np.abs(offsets) - 30.0) < 0.1)) == found
    assert np.any(np.abs(np.abs(offsets) - 60.0) < 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_weak_clutter_makes_no_walls(seed):
    rng = np.random.default_rng(seed)
    rx = np.repeat(receivers(30, seed), 12, axis=0)
    one = np.ones(len(rx))
    clutter = paths(rx, EAST, loss=30.0, loss_std=10.0)
    direct = np.linalg.norm(TX - rx, axis=-1)
    clutter = Paths(
        **vars(clutter)
        | {
            "length": direct + rng.uniform(1, 60, len(rx)),
            "azimuth": rng.uniform(0, 360, len(rx)),
            "length_std": 0.05 * one,
            "azimuth_std": 1.5 * one,
        }
    )
    selected = select(table(clutter))
    environment, _ = reconstruct(selected)
    assert environment.reflectors.sizes["reflector"] == 0
    # a search that asks for no evidence finds many groups; each is told to be an accident
    measured = Paths.from_table(selected)
    measured = measured.take(selected["accepted"].values)
    by_chance = [
        Wall(measured, group.line, group.inliers) for group in find_groups(measured, 3, least_evidence=-np.inf)
    ]
    nothing = np.empty((0, 3))
    no_curved = KnownCurved(np.empty(0, dtype=object), lambda *_: (np.empty(0, dtype=np.int64),) * 2)
    decision = decide_walls(
        by_chance, [], Legs(nothing, nothing), Links(measured.tx, measured.rx), np.inf, 3, no_curved
    )
    assert decision.walls == []
    assert {why for _, why in decision.rejected} == {Reason.FALSE_ALARM}


def test_a_double_reflection_in_a_right_angled_corner_is_found_by_its_known_wall():
    rx = receivers(10)
    south, corner = wall(paths(rx, SOUTH)), wall(paths(rx[:8], SOUTH, EAST, loss=9.0))
    assert corner_pairs([south, corner]) == [(1, 0)]
    # whichever wall came first the image is the same
    assert corner_pairs([south, wall(paths(rx[:8], EAST, SOUTH, loss=9.0))]) == [(1, 0)]
    # two real walls that meet in a corner are none
    assert corner_pairs([south, wall(paths(rx[:8], EAST))]) == []
    # nor is a chain off walls at 84 degrees, whose two orders have images of their own
    assert corner_pairs([south, wall(paths(rx[:8], SOUTH, (174.0, -60.0), loss=9.0))]) == []


def test_diffuse_paths_do_not_belong_to_the_wall():
    rx = receivers(9)
    specular = paths(rx, SOUTH, loss=np.where(np.arange(9) < 7, 6.0, 24.0))
    specular.length[7:] += 0.04  # longer, as off a point beside the specular one
    environment, merged = reconstruct(select(table(specular), max_reflection_loss=30.0), max_gap=np.inf)
    assert merged["accepted"].values.tolist() == 7 * [True] + 2 * [False]
    np.testing.assert_allclose(np.abs(environment.reflectors["offset"].values), 30.0, atol=1e-6)


def test_errors_are_widened_in_proportion_or_by_a_constant():
    rng = np.random.default_rng(7)
    std = 10 ** rng.uniform(-3, -1, 2000)
    # a median absolute deviation of 2000 is right to 3 %
    np.testing.assert_allclose(widen_errors(3 * std * rng.standard_normal(2000), std, std), 3 * std, rtol=0.15)
    common = np.hypot(std, 0.03) * rng.standard_normal(2000)
    wider = widen_errors(common, std, std)
    assert wider.min() == pytest.approx(0.03, rel=0.3)
    assert wider.max() == pytest.approx(np.hypot(0.1, 0.03), rel=0.3)
    assert np.all(widen_errors(0.1 * std, std, std) >= std)


def test_a_weighted_median_follows_the_weight():
    values = np.array([1.0, 2.0, 10.0])
    assert weighted_quantile(values, np.ones(3), 0.5) == 2.0
    assert weighted_quantile(values, np.array([1e-6, 1e-6, 1.0]), 0.5) == pytest.approx(10.0, abs=1e-4)
