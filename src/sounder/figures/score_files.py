"""Table and figures of a score, as files."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from erm.common.atomic import atomic_path
from erm.common.console import drawing, save_figure
from sounder.figures.score import ERRORS, Against, detection, errors, normalised
from sounder.mpc.score import Score


@drawing()
def write_score(score: Score, out: Path, *, suffix: str = "png") -> list[Path]:
    """Write a score: ``paths.csv`` with a row for each true path, and figures over SNR and over separation.

    Returns
    -------
    list of Path
        Files. There is no figure over the SNR if no SNR is known.

    Raises
    ------
    DataError
        The folder cannot be written to.
    """
    with atomic_path(out / "paths.csv") as temporary:
        score.paths.to_dataframe().to_csv(temporary, index=False)
    written = [out / "paths.csv"]
    kinds: list[Against] = ["snr", "separation"]
    for against in kinds:
        if not np.isfinite(score.paths[against].values).any():
            continue
        figure = Figure(figsize=(9.6, 5.6), layout="constrained")
        first, *others = figure.subplots(2, 3).flat
        detection(score, first, against=against)
        for parameter, ax in zip(ERRORS, others, strict=False):
            errors(score, ax, parameter=parameter, against=against)
        normalised(score, others[-1])
        written.append(out / f"against_{against}.{suffix}")
        save_figure(figure, written[-1])
    return written
