"""Score of the MPCs in files: products and MPC tables compared with true paths."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from erm.common.errors import DataError
from erm.common.gate.nesting import parse_json
from erm.common.storage import open_group, require_axes
from erm.mpcs.files import LARGEST_STD, read_csv, read_product
from sounder.instrument.description import Sounder
from sounder.mpc.score import Gates, Score, score, with_snr

TRUTH = "truth/paths.h5 of `sounder simulate`, an MPC table (.csv) or a product"


def score_products(
    products: Sequence[Path],
    truth: Path,
    *,
    gates: Gates | None = None,
    dynamic_range: float = 25.0,
    least_snr: float = 10.0,
) -> tuple[Score, list[str]]:
    """Compare the MPCs of products, or of MPC tables, with true paths.

    Parameters
    ----------
    products : sequence of Path
        Products of ``sounder process``, or MPC tables (.csv), whose SNR is not known.
    truth : Path
        ``truth/paths.h5`` of ``sounder simulate``, an MPC table (.csv), or another product. Positions without a product
        are left out.
    gates, dynamic_range, least_snr
        As for :func:`sounder.score`.

    Returns
    -------
    score : Score
    problems : list of str
        One line for each file that could not be used.

    Raises
    ------
    DataError
        The truth cannot be read, or no product can.
    """
    true_paths, problems = read_truth(truth)
    names = true_paths["position"].values.astype(str)
    estimates, paths, periods = [], [], set()
    for product in products:
        try:
            mpcs, complaints, root = _read(product)
            # a product without MPCs is about a position, too
            positions = np.unique(
                (mpcs if root is None or "position" not in root else root)["position"].values.astype(str)
            ).tolist()
            if unknown := sorted(set(positions) - set(names)):
                known = ", ".join(sorted(set(names))[:3])
                raise DataError(f"{product}: position {unknown[0]} is not in {truth}, which holds {known} and others")
            local = true_paths.isel(path=np.flatnonzero(np.isin(names, positions)))
            if root is not None:
                sounder = _description(root, product)
                local = with_snr(local, open_group(product, "/daps"), sounder)
                periods.add(sounder.waveform.period)
        except DataError as error:
            problems.append(str(error))
            continue
        problems += complaints
        estimates.append(mpcs)
        paths.append(local)
    if not paths:
        raise DataError("\n".join(problems))
    if len(periods) > 1:
        raise DataError(f"{products[0]} and others have waveforms of different periods; score them one by one")
    result = score(
        xr.concat(estimates, dim="mpc", join="outer"),
        xr.concat(paths, dim="path", join="outer"),
        gates=gates,
        dynamic_range=dynamic_range,
        least_snr=least_snr,
        period=periods.pop() if periods else None,
    )
    return result, problems


def read_truth(path: Path) -> tuple[xr.Dataset, list[str]]:
    """Read true paths.

    Returns
    -------
    paths : xarray.Dataset
        Along ``path``: ``position``, ``delay``, ``azimuth``, ``elevation``, ``path_gain``.
    problems : list of str
        One line for each row of a table that cannot be used.

    Raises
    ------
    DataError
        The file is neither the truth of ``sounder simulate`` nor a table of MPCs.
    """
    problems: list[str] = []
    if path.suffix.lower() == ".csv":
        table, problems = read_csv(path)
    elif "path" in (traced := open_group(path, expected=TRUTH)).dims:
        table = traced
    else:
        table, problems = read_product(path)
    names = ["position", "delay", "azimuth", "elevation", "path_gain"]
    if missing := [name for name in names if name not in table]:
        raise DataError(f"{path}: has no {missing[0]}; expected {TRUTH}")
    table = table[names].rename({} if "path" in table.dims else {"mpc": "path"})
    require_axes(table, path, dict.fromkeys(names[1:], ("path",)))
    if table["position"].dims != ("path",):
        raise DataError(f"{path}: position is not the name of each path; expected {TRUTH}")
    for name in names[1:]:
        values, most = table[name].values, 2 * LARGEST_STD[f"{name}_std"]
        beyond = values[
            (values > most) | ((values < -most) & (name != "path_gain"))
        ]  # a path may have no gain: -inf dB
        if beyond.size:
            raise DataError(f"{path}: {name} is {beyond[0]:g}; expected {-most:g} to {most:g}")
    return table, problems


def _read(path: Path) -> tuple[xr.Dataset, list[str], xr.Dataset | None]:
    """MPC table and problems of a file; also the root group if it is a product."""
    if path.suffix.lower() == ".csv":
        return *read_csv(path), None
    return *read_product(path), open_group(path)


def _description(root: xr.Dataset, product: Path) -> Sounder:
    try:
        tables = parse_json(str(root.attrs.get("sounder")))
    except ValueError:
        raise DataError(f"{product}: attribute sounder is missing or not JSON; process the recording again") from None
    return Sounder.from_tables(tables, product)
