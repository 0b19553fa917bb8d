"""What denser positions, finer rotation, sharper beams, more bandwidth and more power bring, through captures.

Two straight routes of the campaign are measured again with one setting changed at a time. What is judged by stays the
same: the true single bounces off walls of the densest positions.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from erm.evaluate import evaluate_walls, point_errors, summary
from erm.geometry import FloatArray
from erm.letter.captures import AS_IT_IS, Campaign, Captures, Change, Link
from erm.letter.routes import MERGED, Study, perpendicular_errors, study
from erm.letter.truth import NO_PATH, behind, is_single_wall_bounce, rays_of
from erm.outline import outline_of

LINES = (("RX1_L", "RX9_L"), ("RX11_L", "RX16_L"))
"""First and last position of each straight route."""
SPACING = 10.0  # m, of the positions where the spacing is not what changes
DENSEST = 2.5  # m
ON_WALL = 0.3  # m; a true reflection point nearer than this to a wall of the map is on it


@dataclass(frozen=True)
class Knob:
    """A setting and its values.

    Parameters
    ----------
    name, unit : str
    values : tuple of float
        In the order of growing effort.
    usual : float
        The letter's.
    change : callable
        Instrument with a value; None where the positions change instead.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    usual: float
    change: Callable[[float], Change] | None


KNOBS = (
    Knob("RX spacing", "m", (20.0, 10.0, 5.0, 2.5), SPACING, None),
    Knob("azimuth step", "°", (20.0, 10.0, 5.0, 2.5), 10.0, lambda value: Change(azimuth_step=value)),
    Knob("HPBW", "°", (40.0, 20.0, 10.0, 5.0), 10.0, lambda value: Change(beamwidth=value)),
    Knob("bandwidth", "GHz", (0.3, 0.6, 1.2, 2.4, 4.8), 1.2, lambda value: Change(bandwidth=1e9 * value)),
    Knob("SNR change", "dB", (-30.0, -20.0, -10.0, 0.0, 10.0), 0.0, lambda value: Change(power=value)),
)


@dataclass(frozen=True)
class Outcome:
    """What one setting gave.

    Parameters
    ----------
    value : float
        Of the knob.
    positions : int
    snr : float
        Median over the MPCs of power over noise [dB].
    mpcs : int
    stray : int
        MPCs that no path explains: remainders of stronger ones, and paths that were not told apart.
    completeness : float
        Share of the true reflection points of the densest positions that lie on a wall of the map.
    false : int
        Walls that stand for no face.
    point_error : float
        RMSE in plan of the reflection points of single MPCs, to the true ones [m].
    wall_error : float
        RMSE of merged reflection points across their face [m]; of true single bounces, as ``point_error``.
    """

    value: float
    positions: int
    snr: float
    mpcs: int
    stray: int
    completeness: float
    false: int
    point_error: float
    wall_error: float


@dataclass(frozen=True)
class Sweep:
    """A knob and what its values gave, in their order."""

    knob: Knob
    outcomes: tuple[Outcome, ...]

    def at_usual(self) -> Outcome:
        """Outcome of the letter's setting."""
        return self.outcomes[self.knob.values.index(self.knob.usual)]


def along(campaign: Campaign, spacing: float, lines: Sequence[tuple[str, str]] = LINES) -> Campaign:
    """The campaign with positions every ``spacing`` [m] along lines between two of its positions each."""
    known = {link.name: link for link in campaign.links}
    links: list[Link] = []
    for first, last in lines:
        start, end = np.array(known[first].rx), np.array(known[last].rx)
        length = float(np.linalg.norm(end - start))
        for i in range(int(length / spacing + 1e-6) + 1):
            east, north, up = (start + i * spacing / length * (end - start)).tolist()
            links.append(Link(f"{first}+{i * spacing:g}", known[first].tx, (east, north, up)))
    return campaign.at(links)


def sweep(
    campaign: Campaign,
    captures: Captures,
    knobs: Sequence[Knob] = KNOBS,
    *,
    spacing: float = SPACING,
    densest: float = DENSEST,
    progress: Callable[[], None] | None = None,
) -> list[Sweep]:
    """Turn every knob through its values, the others at the letter's.

    Parameters
    ----------
    spacing : float
        Of the positions where it is not what changes [m].
    densest : float
        Of the positions whose true reflection points are judged by [m].
    progress : callable, optional
        Called after each value.
    """
    reference = true_points(along(campaign, densest))
    known: dict[tuple[float, Change], Outcome] = {}
    sweeps = []
    for knob in knobs:
        outcomes = []
        for value in knob.values:
            setting = (value, AS_IT_IS) if knob.change is None else (spacing, knob.change(value))
            if value == knob.usual:
                setting = (spacing, AS_IT_IS)  # the shipped instrument itself
            if setting not in known:
                studied = study(along(campaign, setting[0]), captures, setting[1])
                known[setting] = judged(studied, reference, value)
            outcomes.append(known[setting])
            if progress is not None:
                progress()
        named = tuple(
            Outcome(**{**vars(one), "value": value}) for one, value in zip(outcomes, knob.values, strict=True)
        )
        sweeps.append(Sweep(knob, named))
    return sweeps


def true_points(campaign: Campaign) -> FloatArray:
    """Where the single bounces off walls of a campaign truly are (point, 2) [m]."""
    rays = rays_of(campaign.to_order(1))
    return rays.vertex[is_single_wall_bounce(campaign, rays), :2]


def judged(studied: Study, reference: FloatArray, value: float) -> Outcome:
    """Judge a map by true reflection points (point, 2), and its own reflection points by theirs."""
    walls = outline_of(studied.environment)
    distance = point_errors(reference, walls).distance if len(walls) else np.full(len(reference), np.inf)
    single = np.flatnonzero(studied.on_walls & (studied.face >= 0))
    kept = studied.table.isel(mpc=single)
    rays = rays_of(studied.campaign)
    there = rays.vertex[behind(kept, studied.campaign, rays), :2]
    across = perpendicular_errors(studied, studied.on_walls & (studied.face >= 0))[MERGED]
    return Outcome(
        value=value,
        positions=len(studied.campaign.links),
        snr=studied.snr,
        mpcs=studied.mpcs.sizes["mpc"],
        stray=int(np.count_nonzero(behind(studied.mpcs, studied.campaign, rays) == NO_PATH)),
        completeness=float(np.mean(distance < ON_WALL)),
        false=int(evaluate_walls(studied.environment, outline_of(studied.campaign.environment))["false"]),
        point_error=summary(np.linalg.norm(kept["reflection_point"].values[:, :2] - there, axis=1))["rmse"],
        wall_error=summary(across)["rmse"],
    )


def gains(sweeps: Sequence[Sweep]) -> dict[str, Mapping[str, float]]:
    """By knob, what more effort than the letter's brings at best.

    Returns
    -------
    dict of str to mapping
        ``completeness``: what is added; ``point_error``, ``wall_error``: how many times smaller.
    """
    found: dict[str, Mapping[str, float]] = {}
    for one in sweeps:
        usual = one.at_usual()
        more = one.outcomes[one.outcomes.index(usual) :]
        best = {name: min(getattr(o, name) for o in more) for name in ("point_error", "wall_error")}
        found[one.knob.name] = {
            "completeness": max(o.completeness for o in more) - usual.completeness,
            **{name: getattr(usual, name) / value for name, value in best.items()},
        }
    return found
