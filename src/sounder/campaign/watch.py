"""Watch the folder of a campaign: process recordings as they appear, and renew map and page."""

import glob
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from erm.common.console import counted
from erm.common.errors import DataError
from sounder.campaign.description import Campaign, load_campaign
from sounder.campaign.result import REPORT
from sounder.campaign.run import run_campaign
from sounder.campaign.worth import worth
from sounder.processing.position import Outcome

INTERVAL = 5.0
"""Time between two looks at the folder [s]: longer than the 2 s to which some file systems round times."""
Stamp = tuple[tuple[str, int, int], ...]


def watch_campaign(
    path: Path | str,
    out: Path | str | None = None,
    *,
    processing: Mapping[str, Any] | None = None,
    interval: float = INTERVAL,
    tell: Callable[[str], None] = print,
    wait: Callable[[float], None] = time.sleep,
) -> None:
    """Run a campaign again whenever a recording appears or changes, until it is interrupted.

    A recording counts when it is whole: neither size nor time of it, or of a file of the same name with another
    suffix, have changed from one look to the next. One that still cannot be read is told, and tried again when it
    changes. Each new product is told in one line (`sounder.campaign.worth.worth`) as soon as it is there, also of many
    that were waiting; then the map is made. Whatever was made is kept, so that the watch can be stopped and started
    again at any time.

    Parameters
    ----------
    path : path
        Campaign file. It is read again when it changes.
    out : path, optional
        As for :func:`sounder.run_campaign`.
    processing : mapping, optional
        Options of `sounder.campaign.description.Processing` that override those of the file.
    interval : float
        Time between two looks [s].
    tell, wait : callable
        Called with each line, and with the interval between two looks.
    """
    told: set[str] = set()
    before: dict[Path, Stamp] = {}
    handled: dict[Path, Stamp] = {}

    def tell_new(lines: Iterable[str]) -> None:
        for line in lines:
            if line not in told:
                told.add(line)
                tell(line)

    tell(f"{path}: watching; Ctrl-C ends it")
    while True:
        try:
            campaign = load_campaign(path).processed_by(**processing or {})
            folder = campaign.out if out is None else Path(out)
            recordings = {file for patterns in campaign.files(folder) for found in patterns.values() for file in found}
            now = {file: _stamp(file) for file in (*recordings, *campaign.inputs)}
            whole = {file: stamp for file, stamp in now.items() if before.get(file) == stamp}
            explained = all(file in whole for file in campaign.inputs)
            changed = whole.items() - handled.items() or handled.keys() - now.keys()
            if explained and changed and (ready := recordings & set(whole)):
                handled = whole
                tell_new(_run(campaign, folder, ready, tell))
            before = now
        except DataError as error:
            tell_new(str(error).splitlines())
        wait(interval)


def _run(campaign: Campaign, out: Path, ready: set[Path], tell: Callable[[str], None]) -> list[str]:
    """Run a campaign with some of its recordings, and return what is to tell besides its new products."""
    lines: list[str] = []

    def tell_position(outcome: Outcome) -> None:
        for product in outcome.products:
            lines.append(worth(product))
            if not outcome.already:
                tell(lines[-1])

    result = run_campaign(campaign, out, only=ready, processed=tell_position)
    tell(f"{counted(len(result.products), 'position')}; {result.reflectors}; {out / REPORT}")
    remarks = {remark for line in lines for remark in line.split("; ")}
    return [line for line in (*result.failures, *result.notes) if line.split("; ")[0].split(": ", 2)[-1] not in remarks]


def _stamp(path: Path) -> Stamp:
    """Names, sizes and times of a file and of those of its name with other suffixes, which may hold its samples."""
    found = sorted({path, *path.parent.glob(f"{glob.escape(path.stem)}.*")})
    stats = [(file.name, file.stat()) for file in found if file.exists()]
    return tuple((name, stat.st_size, stat.st_mtime_ns) for name, stat in stats)
