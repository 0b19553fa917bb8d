"""All parameters of a position: names, units, definitions and sources."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """What a parameter is.

    Attributes
    ----------
    unit : str
    text : str
        Name in words.
    definition : str
        Equation and source.
    logarithmic : bool
        Whether its distribution is given for its logarithm, as TR 38.901, Table 7.5-6 does.
    """

    unit: str
    text: str
    definition: str
    logarithmic: bool = False


_R = "R = |sum p exp(j angle)| / sum p"
_TR = f"sqrt(-2 ln R), {_R}; TR 38.901 Annex A.1, Eq. A-1"
_FLEURY = f"sqrt(1 - R^2), {_R}, in degree; Fleury 2000"


def _angles(text: str, definition: str) -> Parameter:
    return Parameter("degree", text, definition, logarithmic=True)


PARAMETERS = {
    "path_loss": Parameter("dB", "path loss", "-10 lg of the sum of the path gains"),
    "mpcs": Parameter("1", "number of paths", "paths over the threshold; ITU-R P.1407 2.2.6"),
    "rms_delay_spread": Parameter(
        "s", "RMS delay spread", "square root of the second central moment of delay; ITU-R P.1407 2.2.3", True
    ),
    "mean_excess_delay": Parameter("s", "mean excess delay", "mean delay after the first path; ITU-R P.1407 2.2.2"),
    "maximum_excess_delay": Parameter("s", "maximum excess delay", "from first to last path; ITU-R P.1407 2.2.5"),
    "coherence_bandwidth": Parameter(
        "Hz", "coherence bandwidth", "least separation at which |sum p exp(-j2 pi f t)| is 0.5; ITU-R P.1407 5.2.1"
    ),
    "azimuth_spread_arrival": _angles("azimuth spread of arrival", _TR),
    "azimuth_spread_arrival_fleury": _angles("azimuth spread of arrival (Fleury)", _FLEURY),
    "zenith_spread_arrival": _angles("zenith spread of arrival", _TR),
    "zenith_spread_arrival_fleury": _angles("zenith spread of arrival (Fleury)", _FLEURY),
    "azimuth_spread_departure": _angles("azimuth spread of departure", _TR),
    "azimuth_spread_departure_fleury": _angles("azimuth spread of departure (Fleury)", _FLEURY),
    "zenith_spread_departure": _angles("zenith spread of departure", _TR),
    "zenith_spread_departure_fleury": _angles("zenith spread of departure (Fleury)", _FLEURY),
    "k_strongest": Parameter("dB", "K, strongest path", "strongest path over all others"),
    "k_los": Parameter("dB", "K, direct path", "direct path, within 1 ns and 3 deviations of d/c, over all others"),
    "clusters": Parameter("1", "number of clusters", "K-power-means or DBSCAN over the MCD (Czink et al. 2006)"),
    "cluster_delay_spread": Parameter("s", "delay spread within clusters", "root of the power-weighted mean square"),
    "cluster_azimuth_spread": Parameter("degree", "azimuth spread within clusters", "the same; TR 38.901 A-1 in each"),
    "cluster_zenith_spread": Parameter("degree", "zenith spread within clusters", "the same; TR 38.901 A-1 in each"),
    "inter_cluster_delay_spread": Parameter("s", "delay spread between clusters", "of their mean delays and powers"),
    "inter_cluster_azimuth_spread": Parameter("degree", "azimuth spread between clusters", "of their mean angles; A-1"),
    "inter_cluster_zenith_spread": Parameter("degree", "zenith spread between clusters", "of their mean angles; A-1"),
}
"""Parameters by name, in the order of tables."""
READ_IN = {"s": (1e9, "ns"), "Hz": (1e-6, "MHz"), "1": (1.0, "")}
"""Factors and units in which people read parameters, by their unit."""
