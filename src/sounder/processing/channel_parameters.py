"""Channel parameters of files: products of ``sounder process`` and tables of MPCs."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from erm.common.errors import DataError
from erm.common.storage import SOFTWARE, open_groups, require_axes, sha256
from erm.mpcs.files import PRODUCT, line_of_sight, read_csv
from erm.mpcs.table import VALUES
from sounder.options import Clustering, Source, Threshold, require_choice
from sounder.parameters.position import position_parameters
from sounder.parameters.selection import select_mpcs, select_pdp


def channel_parameters(
    files: Sequence[Path | str],
    *,
    threshold: str | Threshold | None = None,
    source: Source = "mpcs",
    clusters: Clustering = "none",
) -> tuple[xr.Dataset, list[str]]:
    """Compute the channel parameters of all positions.

    Parameters
    ----------
    files : sequence of path
        Products of ``sounder process``, or tables of MPCs (.csv).
    threshold : str or Threshold, optional
        Which paths count; see :class:`sounder.options.Threshold`. Default: all MPCs of the file, or samples 12 dB over
        the noise of a PDP.
    source : {"mpcs", "pdp"}
        Compute from MPCs, or from the omnidirectional PDP of a product.
    clusters : {"none", "k-power-means", "dbscan"}
        How MPCs are grouped into clusters.

    Returns
    -------
    parameters : xarray.Dataset
        Along ``position``: the parameters of :data:`sounder.parameters.catalogue.PARAMETERS` with their standard
        deviations (``_std``); ``los``, ``tx_position``, ``rx_position``, ``distance`` [m], ``frequency`` [Hz]; how
        paths were selected (``definition``, ``source``, ``threshold``, ``noise``, ``antennas``, ``clustering``);
        ``doubts``, what checks of the recording made doubtful; and where it comes from (``file``, ``sha256``,
        ``software``).
    problems : list of str
        One line for each file that cannot be used.

    Raises
    ------
    DataError
        No file can be used.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import sounder
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> jobs, _ = sounder.gather(recordings, calibration=b2b)
    >>> outcome = sounder.process(jobs, pathlib.Path(tempfile.mkdtemp()))
    >>> parameters, problems = sounder.channel_parameters(outcome.products)
    >>> spread = parameters["rms_delay_spread"]
    >>> print(f"{spread.item() * 1e9:.1f} ns: {spread.attrs['definition']}")
    12.3 ns: square root of the second central moment of delay; ITU-R P.1407 2.2.3
    >>> print(parameters["threshold"].item())
    MPCs extracted with at most 0.05 false MPCs a position by noise
    """
    require_choice("source", source, Source)
    require_choice("clusters", clusters, Clustering)
    chosen = None if threshold is None else Threshold.of(threshold)
    rows, problems = [], []
    for path in map(Path, files):
        try:
            positions = _of_table(path) if path.suffix.lower() == ".csv" else [_of_product(path, source)]
            if source == "pdp" and path.suffix.lower() == ".csv":
                raise DataError(f"{path}: a table of MPCs has no PDP; give products, or compute from MPCs")
        except DataError as error:
            problems.append(str(error))
            continue
        for about, group in positions:
            selection = select_mpcs(group, chosen) if source == "mpcs" else select_pdp(group, chosen)
            distance = float(np.linalg.norm(about["tx_position"] - about["rx_position"]))
            one = position_parameters(selection, distance=distance, los=about["los"], clusters=clusters)
            rows.append(_row(one, about, path, distance, clusters))
    if not rows:
        raise DataError("\n".join(problems) or "no file; expected products of `sounder process` or tables of MPCs")
    return xr.concat(rows, "position", combine_attrs="override").drop_attrs(deep=False), problems


def notes_on_parameters(parameters: xr.Dataset) -> list[str]:
    """One line for each position that does not count in statistics: without paths, or with something doubtful."""
    notes = []
    for i, name in enumerate(parameters["position"].values.tolist()):
        one = parameters.isel(position=i)
        where = f"{one['file'].item()}: {name}"
        if not one["mpcs"].item():
            notes.append(f"{where}: no path counts ({one['threshold'].item()}); no parameters")
        if doubts := one["doubts"].item():
            notes.append(f"{where}: {doubts} doubtful; left out of statistics; see sounder info")
    return notes


def _of_product(path: Path, source: Source) -> tuple[dict[str, Any], xr.Dataset]:
    """Facts of a product, and its MPCs or its DAPS."""
    root, group = open_groups(path, "/", "/mpc" if source == "mpcs" else "/daps", expected=PRODUCT)
    needed = {"tx_position", "rx_position", "position", "frequency"} - {*root.variables, *root.attrs}
    needed |= ({*VALUES} if source == "mpcs" else {"pdp", "pulse_energy"}) - {*group.variables, *group.attrs}
    if needed:
        raise DataError(f"{path}: has no {sorted(needed)[0]}; expected {PRODUCT}")
    measured = dict.fromkeys(VALUES, ("mpc",)) if source == "mpcs" else dict.fromkeys(("pdp", "delay"), ("delay",))
    require_axes(group, path, measured)
    for name in {"pulse_energy", "independent_samples"} & group.attrs.keys():
        if group.attrs[name] <= 0:
            raise DataError(f"{path}: {name} is not positive; process the recording again")
    require_axes(root, path, dict.fromkeys(("tx_position", "rx_position"), ("position", "xyz")))
    if root["position"].size != 1:
        raise DataError(f"{path}: holds {root['position'].size} positions; expected one in a file")
    about: dict[str, Any] = {"position": str(root["position"].values.item()), "los": line_of_sight(root, path)}
    about["doubts"] = str(root.attrs.get("doubts", ""))
    about |= {f"{end}_position": np.ravel(root[f"{end}_position"].values) for end in ("tx", "rx")}
    return about | {"frequency": root.attrs["frequency"]}, group


def _of_table(path: Path) -> Iterable[tuple[dict[str, Any], xr.Dataset]]:
    """Facts and MPCs of each antenna pair in a table of MPCs, in the order of the table."""
    table, problems = read_csv(path)
    if problems:
        raise DataError(problems[0])
    ends = np.hstack([table["tx_position"].values, table["rx_position"].values])
    names = table["position"].values.astype(str)
    keys = list(zip(names.tolist(), map(tuple, ends.tolist()), strict=True))
    for key in dict.fromkeys(keys):
        rows = table.isel(mpc=[i for i, other in enumerate(keys) if other == key])
        first = rows.isel(mpc=0)
        about: dict[str, Any] = {"position": key[0], "los": int(first["los"]), "frequency": float(first["frequency"])}
        about["doubts"] = ""
        about |= {f"{end}_position": first[f"{end}_position"].values for end in ("tx", "rx")}
        yield about, rows


def _row(one: xr.Dataset, about: dict[str, Any], path: Path, distance: float, clusters: Clustering) -> xr.Dataset:
    """Parameters of a position along ``position`` of length 1, with all facts about them."""
    texts = {name: one.attrs[name] for name in ("definition", "source", "threshold", "noise", "antennas")}
    texts |= {
        "doubts": about["doubts"],
        "clustering": clusters,
        "file": path.name,
        "sha256": sha256(path),
        "software": SOFTWARE,
    }
    row = one.drop_attrs(deep=False).expand_dims(position=[about["position"]])
    facts: dict[str, Any] = {
        "los": ("position", [about["los"]], {"long_name": "line of sight: 1 yes, 0 no, -1 unknown"})
    }
    for end in ("tx", "rx"):
        place = about[f"{end}_position"][None]
        facts[f"{end}_position"] = (("position", "xyz"), place, {"units": "m", "long_name": f"{end.upper()} position"})
    facts["distance"] = ("position", [distance], {"units": "m", "long_name": "distance from TX to RX"})
    facts["frequency"] = ("position", [about["frequency"]], {"units": "Hz", "long_name": "carrier frequency"})
    return row.assign(facts | {name: ("position", [text], {"long_name": name}) for name, text in texts.items()})
