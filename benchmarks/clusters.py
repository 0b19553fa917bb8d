"""How well the number of clusters is found on random channels: the choices behind `sounder.parameters.clusters`.

Channels of 2 to 7 clusters of 3 to 11 MPCs: azimuths Laplacian about a random centre, delays exponential after a random
start, powers log-normal. Centres closer than the clusters are wide cannot be told apart, so that no method finds all.
"""

import numpy as np
from harness import conclude

from sounder.parameters import clusters
from sounder.parameters.multipath_distance import features

CHANNELS = 200
WIDTH, DECAY = 4.0, 5e-9  # scale of the azimuths [degree] and of the delays [s] in a cluster
RADII = (0.03, 0.05, 0.07, 0.1, 0.14, 0.17, 0.2)


def channel(rng):
    """Number of clusters, and points and powers of the MPCs."""
    number = int(rng.integers(2, 8))
    label = np.repeat(np.arange(number), rng.integers(3, 12, number))
    centre, start, level = rng.uniform(0, 360, number), rng.uniform(0, 800e-9, number), rng.normal(0, 5, number)
    azimuth = centre[label] + rng.laplace(0, WIDTH, label.size)
    delay = start[label] + rng.exponential(DECAY, label.size)
    power = 10 ** ((level[label] + rng.normal(0, 3, label.size)) / 10)
    return number, features(delay, azimuth, rng.normal(0, 2, label.size)), power


def main() -> None:
    rng = np.random.default_rng(0)
    channels = [channel(rng) for _ in range(CHANNELS)]
    methods = {"k-power-means, silhouette": clusters.k_power_means}
    for radius in RADII:
        methods[f"dbscan, radius {radius:g}"] = lambda points, power, radius=radius: clusters.dbscan(
            points, power, radius
        )
    print(f"{'':28} exact  within 1   mean error")
    found = []
    for name, method in methods.items():
        error = np.array([method(points, power).max() + 1 - number for number, points, power in channels])
        print(f"{name:28} {np.mean(error == 0):5.0%} {np.mean(np.abs(error) <= 1):9.0%} {error.mean():+12.2f}")
        found.append(float(np.mean(np.abs(error) <= 1)))
    conclude("K-power-means finds the number of clusters to 1 in 90 % of random channels", found[0] / 0.9, None)


if __name__ == "__main__":
    main()
