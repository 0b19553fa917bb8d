"""Components are explained by the reflectors that they met, and by none that they did not."""

import numpy as np
import pytest

from erm.evaluation.explain import azimuth_sectors, count_reflectors, explain, last_reflector, reflector_names
from erm.maps.environment import Environment
from erm.mpcs.table import make_table
from erm.tracing.trace import trace

TX, RX = (0.0, 0.0, 10.0), (30.0, 5.0, 2.0)


@pytest.fixture(scope="module")
def corridor() -> Environment:
    return Environment.walls([[[-50, 20], [80, 20]], [[80, -15], [-50, -15]]]).with_poles([[10.0, 10.0]], 0.2)


def received(place: Environment, late: float = 0.0) -> tuple:
    paths = trace(place, TX, RX, 132e9, max_order=2)
    columns = {name: paths[name].values for name in ("delay", "azimuth", "elevation", "path_gain")}
    columns["delay"] = columns["delay"] + late
    table = make_table({"position": "RX", "tx_position": TX, "rx_position": RX, "frequency": 132e9, **columns})
    return table, paths


def test_every_path_is_told_by_the_reflectors_it_met(corridor):
    table, paths = received(corridor, late=0.1e-9)
    names = reflector_names(corridor)
    assert names == ["W0", "W1", "P2"]  # rows of the table
    met = ["+".join(names[i] for i in row if i >= 0) or "direct" for row in paths["reflector"].values]
    assert explain(table, corridor).tolist() == met
    assert {"direct", "W0", "W1", "P2", "W0+W1", "W1+W0"} <= set(met)


def test_a_component_no_path_is_near_to_is_not_explained(corridor):
    table, _ = received(corridor)
    later = table.assign(delay=table["delay"] + 20e-9)
    assert explain(later.isel(mpc=[-1]), corridor).tolist() == [""]
    assert explain(table, Environment.empty()).tolist().count("direct") == 1


def test_a_sector_holds_its_components_and_goes_round_through_north_and_east():
    found = azimuth_sectors(
        np.array([350.0, 5.0, 20.0, 170.0, 90.0]), ["W1", "W1", "W1", "W1", ""], margin=5.0, gap=60.0
    )
    assert [(one.name, one.start, one.stop, one.components) for one in found] == [
        ("W1", 345.0, 385.0, 3),
        ("W1", 165.0, 175.0, 1),
    ]


def test_a_component_comes_off_the_last_reflector_it_met():
    labels = ["direct", "ground", "W3", "W3+W5", "W5+ground", "ground+ceiling", ""]
    assert [last_reflector(label) for label in labels] == ["direct", "direct", "W3", "W5", "W5", "direct", ""]
    assert [count_reflectors(label) for label in labels] == [0, 0, 1, 2, 1, 0, 0]
