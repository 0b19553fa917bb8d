"""Recordings to products: each position on its own, what fails is named and the rest is done."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from erm.common.errors import DataError
from erm.common.storage import clear_leftovers
from sounder.options import Options
from sounder.processing.jobs import Job, told_once
from sounder.processing.position import Filters, Outcome, made_before, process_position
from sounder.recordings.recording import Recording


class Targets:
    """File names in one folder; no two outputs get the same, none that of an input.

    Parameters
    ----------
    out : Path
        The folder.
    inputs : iterable of Path
        Files that are read, and so never written to.
    """

    def __init__(self, out: Path, inputs: Iterable[Path]) -> None:
        self._out = out
        self._inputs = {path.resolve() for path in inputs}
        self._taken: dict[Path, str] = {}

    def claim(self, recording: Recording, name: str | None = None) -> Path:
        """Name the file of a position, after the position unless a name is given.

        Raises
        ------
        DataError
            Another position has the name, or it is that of an input.
        """
        safe = re.sub(r"[^\w.+-]+", "_", recording.name).strip("._") or recording.source.stem
        return self.reserve(name or safe, f"{recording.source}: position {recording.name}")

    def reserve(self, name: str, who: str) -> Path:
        """Name a file ``name.h5`` for ``who``, who is named in errors.

        Raises
        ------
        DataError
            Somebody else has the name, or it is that of an input.
        """
        target = self._out / f"{name}.h5"
        if target in self._taken:
            raise DataError(
                f"{who}: {target} is already taken by {self._taken[target]}; "
                "give the positions different names or process them into different folders"
            )
        if target.resolve() in self._inputs:
            raise DataError(f"{who}: the output {target} would replace an input; choose another --out")
        self._taken[target] = who
        return target

    def release(self, target: Path) -> None:
        """Give a name back where nothing was written to it."""
        del self._taken[target]


def process(
    jobs: Sequence[Job],
    out: Path | str,
    *,
    options: Options | None = None,
    threads: int | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    resume: bool = False,
    progress: Callable[[], None] | None = None,
) -> Outcome:
    """Process recordings into one product a position.

    The products are the same, to the last byte, for any number of threads and workers. Of positions of one name the
    first that succeeds has it, in the order of the jobs.

    Parameters
    ----------
    jobs : sequence of Job
        From :func:`sounder.processing.jobs.gather`.
    out : path
        Folder of the products, named after the positions.
    options : Options, optional
    threads : int, optional
        Directions worked on at a time in one process; default one a processor.
    workers : int
        Processes on this machine, by dask.
    scheduler : str, optional
        Address of a running dask scheduler, such as ``tcp://host:8786``; its workers must see the same files.
    resume : bool
        Leave products that are there already and would be made the same again; what a killed process left half
        written is removed.
    progress : callable, optional
        Called after each position.

    Returns
    -------
    Outcome
        In the order of the jobs.

    Raises
    ------
    DataError
        The dask scheduler cannot be reached, or dask is not installed.
    """
    options = options or Options()
    targets = Targets(Path(out), {path for job in jobs for path in (job.recording.source, job.b2b.source)})
    filters = Filters()

    def run(named: Sequence[tuple[Job, Path]]) -> Iterable[Outcome]:
        if workers > 1 or scheduler is not None:
            from sounder.processing import cluster  # distributed is optional and slow to import

            return cluster.run(named, options, workers=workers, threads=threads, scheduler=scheduler)
        return (process_position(job, target, options, filters=filters, threads=threads) for job, target in named)

    def followed(named: dict[int, tuple[Job, Path]]) -> Iterator[tuple[int, Outcome]]:
        """Outcomes by place: of what is there already, then of what is made."""
        missing = dict(named)
        for place, (job, target) in named.items() if resume else ():
            if (part := made_before(job, target, options)) is not None:
                del missing[place]
                yield place, part
            clear_leftovers(target)
        yield from zip(missing, run(list(missing.values())), strict=True)

    parts: dict[int, Outcome] = {}
    while len(parts) < len(jobs):  # once more where a name is free again because its first position failed
        named: dict[int, tuple[Job, Path]] = {}
        refused: dict[int, Outcome] = {}
        for place, job in enumerate(jobs):
            if place not in parts:
                try:
                    named[place] = job, targets.claim(job.recording)
                except DataError as error:
                    refused[place] = Outcome(failures=[str(error)])
        if not named:
            parts |= refused
        for place, part in followed(named):
            parts[place] = part
            if not part.products:
                targets.release(named[place][1])
            if progress is not None:
                progress()
    told = [(failure, job.recording.source) for place, job in enumerate(jobs) for failure in parts[place].failures]
    return Outcome(
        products=[product for place in range(len(jobs)) for product in parts[place].products],
        failures=told_once(told, [job.recording.source for job in jobs]),
        notes=[note for place in range(len(jobs)) for note in parts[place].notes],
        already=sum(part.already for part in parts.values()),
    )
