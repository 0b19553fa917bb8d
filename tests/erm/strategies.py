"""Random MPC tables and maps, for what holds for all of them."""

import numpy as np
from hypothesis import strategies as st

from erm.maps.environment import Environment, Slab
from erm.maps.materials import LIBRARY, Material
from erm.maps.reflectors import make_reflectors
from erm.mpcs.table import OPTIONAL, make_table

NAMES = st.text(st.characters(categories=["L", "N", "P", "S", "Zs"]), min_size=1, max_size=9).map(str.strip)
"""Names of positions in any script, with the separators and quotes of tables."""
OWN = Material("own", permittivity=(3.1, -0.1), conductivity=(0.01, 1.2), height_deviation=1e-4)


@st.composite
def tables(draw):
    """MPC tables of several positions, in which any optional value may be unknown."""
    count = draw(st.integers(0, 5))

    def column(low, high, *, unknown=False):
        value = st.floats(low, high)
        return np.array(draw(st.lists(value | st.just(np.nan) if unknown else value, min_size=count, max_size=count)))

    columns = {
        "position": np.array([draw(NAMES.filter(bool)) for _ in range(count)], dtype=np.str_),
        "los": draw(st.lists(st.integers(-1, 1), min_size=count, max_size=count)),
        "tx_position": np.reshape(column(-5, 5), (count, 1)) * [1, 1, 0.5],
        "rx_position": np.reshape(column(20, 30), (count, 1)) * [1, -1, 0.1],
        "frequency": 132e9,
        "delay": column(3e-7, 6e-7),
        "azimuth": column(0, 360),
        "elevation": column(-90, 90, unknown=True),
        "path_gain": column(-140, -100),
    }
    for name in draw(st.sets(st.sampled_from(sorted(OPTIONAL)))):
        columns[name] = column(0.1, 1, unknown=True) * (1e-9 if OPTIONAL[name] == "s" else 1)
    return make_table(columns)


@st.composite
def maps(draw):
    """Maps of walls and poles with every column set; heights may be infinite, errors, ground and ceiling unknown."""
    count, rng = draw(st.integers(0, 4)), np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = rng.normal(size=(count + 2, 2, 2))
    covariance = root @ root.swapaxes(1, 2)
    covariance[rng.random(count + 2) < 0.2] = np.nan
    table = make_reflectors(
        rng.uniform(-200, 200, (count, 2, 2)),
        base=draw(st.lists(st.sampled_from([-np.inf, -1.5, 0.0]), min_size=count, max_size=count)),
        top=draw(st.lists(st.sampled_from([7.25, 40.0, np.inf]), min_size=count, max_size=count)),
        covariance=covariance[:count],
        support=rng.integers(0, 50, count),
        residual=rng.uniform(0.5, 3, count),
        material=draw(st.lists(st.sampled_from(["own", *LIBRARY]), min_size=count, max_size=count)),
    )
    ground = draw(st.sampled_from([None, Slab(-0.3, "asphalt")]))
    place = Environment(table, ground, draw(st.sampled_from([None, Slab(12.5)])), {"own": OWN})
    poles = draw(st.integers(0, 2))
    top = [8.0, np.inf][:poles]
    return (
        place.with_poles(
            rng.uniform(-50, 50, (poles, 2)),
            rng.uniform(0.1, 0.3, poles),
            top=top,
            covariance=covariance[count:][:poles],
        )
        if poles
        else place
    )
