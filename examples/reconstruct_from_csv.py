"""From a table of multipath components to a map, and from the map to the channel at a new place.

Usage: python examples/reconstruct_from_csv.py mpcs.csv map.geojson map.png
"""

import sys

import numpy as np

from erm.figures import plot_map
from erm.maps.formats import write_map
from erm.mpcs.files import read_mpcs
from erm.mpcs.selection import select
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.trace import trace


def main(mpcs: str, map_file: str, picture: str) -> None:
    """Reconstruct, say why components were left out, draw, and predict one link."""
    table, complaints = read_mpcs([mpcs])
    print("\n".join(complaints))

    environment, merged = reconstruct(select(table))
    write_map(environment, map_file)
    print(environment.reflectors[["normal", "offset", "support"]].to_dataframe())
    print(merged["reason"].to_series().value_counts())

    plot_map(environment, table=merged).figure.savefig(picture, dpi=160, bbox_inches="tight")

    first = table.isel(mpc=0)
    rx = first["rx_position"].values + np.array([1.0, 0.0, 0.0])  # one metre east of a measured position
    paths = trace(environment, first["tx_position"].values, rx, float(first["frequency"]), max_order=1)
    print(paths[["delay", "azimuth", "path_gain"]].to_dataframe())


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
