"""The attacks of the soak. Each takes a folder with a campaign, how often, a generator, and the options."""

import os
import resource
import shutil
import signal
import time
from argparse import Namespace
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from sounder.processing.integrity import check_file

from .forked import Ended, Trial, run_all, started, waited
from .mutations import mutated
from .samples import OUT, SAMPLES, Sample

BATCH = 500
"""Inputs that one child takes."""
LEAST_SHARE = 0.25
"""Share of the inputs that every command line gets, relative to equal shares; chosen."""
PROCESS = f"sounder process @raw/RX1.h5 @raw/RX2.h5 --calibration @back-to-back.h5 --threads 1 --out @{OUT}"
WRITERS = [
    Sample("", command)
    for command in (
        PROCESS,
        f"sounder run @campaign.toml --out @{OUT}",
        f"sounder convert @raw/RX1.h5 --out @{OUT}/c.h5",
        f"erm reconstruct @products/RX1.h5 @products/RX2.h5 --min-support 1 --out @{OUT}/m.h5",
        f"sounder convert @raw/RX1.h5 --out @{OUT}/c.sigmf-meta",
        f"sounder simulate @scene.toml --out @{OUT}",
        f"sounder parameters @products/RX1.h5 --out @{OUT}/p.csv --mpcs @{OUT}/m.csv --point-data @{OUT}/d.csv",
        f"sounder figures @products/RX1.h5 --out @{OUT}",
        f"sounder report @products/RX1.h5 --out @{OUT}/r.html",
        f"sounder score @products/RX1.h5 --truth @truth/paths.h5 --out @{OUT}",
        f"sounder verify @verification.toml --out @{OUT}/v.pdf --history @{OUT}/v.csv",
        f"erm reconstruct @mpcs.csv --min-support 1 --out @{OUT}/m.gpkg --rps @{OUT}/r.csv --calibrated @{OUT}/c.csv",
        *(f"erm export @map.h5 --out @{OUT}/m.{kind}" for kind in ("csv", "dxf", "ply", "obj", "xml")),
        f"erm evaluate @map.h5 --outline @map.geojson --figure @{OUT}/e.svg",
        f"erm predict @map.h5 --tx 4 5 3 --rx 12 3 1.5 --out @{OUT}/t.csv",
    )
]
KILLED = WRITERS[:4]


@dataclass
class Tally:
    """How often what was seen, and what must not be."""

    seen: Counter[str] = field(default_factory=Counter)
    wrong: int = 0

    def note(self, what: str, ended: Ended) -> bool:
        """Count an outcome; a fault is printed. Return whether there was one."""
        faults = ended.faults
        self.seen.update(faults or [f"exit code {ended.code}"])
        self.wrong += bool(faults)
        if faults:
            said = " ".join(ended.said.split())
            print(f"  {what}: {', '.join(faults)} ({ended.seconds:.1f} s): {said[-300:]}", flush=True)
        return bool(faults)

    def __str__(self) -> str:
        counted = ", ".join(f"{name}: {count}" for name, count in sorted(self.seen.items()))
        return f"{counted}; {self.wrong} wrong"


def damage(folder: Path, count: int, rng: np.random.Generator, chosen: Namespace) -> Tally:
    """Number of damaged files of all formats."""
    whole, here, log = folder / "campaign", folder / "damaged", folder / "log"
    shutil.copytree(whole, here)
    samples = [sample for sample in SAMPLES if chosen.only in sample.command]
    files = [whole / file for file in sorted({sample.file for sample in SAMPLES})]
    often = 1 / np.array([sample.seconds for sample in samples])
    often = np.maximum(often / often.sum(), LEAST_SHARE / len(samples))  # cheap commands read as much as dear ones
    drawn = rng.choice(len(samples), count, p=often / often.sum())
    tally = Tally()

    def trial(number: int) -> tuple[str, bytes, Trial]:
        sample, before = samples[drawn[number]], samples[drawn[number - 1]].file
        data = mutated(whole / sample.file, files, rng)

        def prepare() -> None:
            shutil.copyfile(whole / before, here / before)  # the one before is made whole
            (here / sample.file).write_bytes(data)
            shutil.rmtree(here / OUT, ignore_errors=True)

        def verify() -> list[str]:
            read = [here / sample.file] if sample.command.startswith(("sounder process", "sounder check")) else []
            read = [path for path in read if path.suffix == ".h5" and "formats" not in path.parts]
            return _damaged([*read, *(here / OUT).rglob("*.h5")])

        return sample.file, data, Trial(sample.words(here), prepare, verify)

    for begin in range(0, count, BATCH):
        made = [trial(number) for number in range(begin, min(begin + BATCH, count))]
        for number, ended in enumerate(run_all([one for *_, one in made], log)):
            file, data, one = made[number]
            if (
                tally.note(f"input {begin + number}, {file}, {' '.join(map(str, one.command[:2]))}", ended)
                and chosen.keep
            ):
                chosen.keep.mkdir(parents=True, exist_ok=True)
                (chosen.keep / f"{begin + number}-{one.command[1]}-{Path(file).name}").write_bytes(data)
        print(f"  {begin + len(made)} of {count}: {tally}", flush=True)
    shutil.rmtree(here)
    return tally


def flip(folder: Path, count: int, rng: np.random.Generator, _: Namespace) -> Tally:
    """Number of bits flipped in the data of recordings, back-to-backs, products and maps; each must be refused."""
    whole, here, log = folder / "campaign", folder / "flipped", folder / "log"
    shutil.copytree(whole, here)
    targets = [
        (Sample(file, command), _pieces(whole / file))
        for file in ("raw/RX1.h5", "back-to-back.h5", "products/RX1.h5", "map.h5")
        for command in (f"sounder check @{file}", PROCESS)
        if command != PROCESS or file in PROCESS
    ]
    trials = []
    for number in range(count):
        sample, pieces = targets[number % len(targets)]
        place, length = pieces[rng.integers(len(pieces))]
        place, bit = place + int(rng.integers(length)), 1 << int(rng.integers(8))

        def prepare(sample: Sample = sample, place: int = place, bit: int = bit) -> None:
            for file in {one.file for one, _ in targets}:
                shutil.copyfile(whole / file, here / file)
            data = bytearray((whole / sample.file).read_bytes())
            data[place] ^= bit
            (here / sample.file).write_bytes(data)
            shutil.rmtree(here / OUT, ignore_errors=True)

        trials.append(Trial(sample.words(here), prepare, lambda: ["a flipped bit was read"]))
    tally = Tally()
    for number, ended in enumerate(run_all(trials, log)):
        tally.note(f"flip {number}, {trials[number].command[:3]}", ended)
    shutil.rmtree(here)
    return tally


def kill(folder: Path, count: int, rng: np.random.Generator, _: Namespace) -> Tally:
    """Number of runs that are killed, at random moments; what is left is whole, and the next run makes the rest."""
    whole, log = folder / "campaign", folder / "log"
    out, tally = whole / OUT, Tally()
    for sample in KILLED:
        shutil.rmtree(out, ignore_errors=True)
        words = sample.words(whole)
        begun = time.monotonic()
        tally.note("before", waited(started(Trial(words), log), log))
        lasts, expected = time.monotonic() - begun, _contents(out)
        shutil.rmtree(out)
        for number in range(-(-count // len(KILLED))):
            sent = signal.SIGTERM if number % 5 == 4 else signal.SIGKILL
            child = started(Trial(words), log)
            child.join(rng.uniform(0, lasts))
            if child.is_alive():
                os.kill(child.pid, sent)
            ended = waited(child, log)
            left = _contents(out)
            gentle = ended.code == 128 + signal.SIGTERM or ended.code == -signal.SIGTERM  # before Python listens
            unfinished = [name for name in left if ".part/" in name]
            wrong = {
                "ended otherwise": ended.code not in (0, -signal.SIGKILL) and not gentle,
                "a file that is not whole": any(
                    left[name] != expected.get(name) for name in left if name not in unfinished
                ),
                "unfinished files after SIGTERM": gentle and unfinished,
            }
            again = waited(started(Trial(words), log), log)
            made = _contents(out)
            wrong["resumed, other bytes"] = again.code != 0 or any(
                made.get(name) != expected[name] for name in expected
            )
            wrong["resumed, more files"] = len(made) > len(expected)
            tally.seen["left something unfinished"] += bool(unfinished)
            name = "had ended" if not ended.code else "SIGTERM" if gentle else "killed"
            found = [what for what, is_so in wrong.items() if is_so]
            tally.seen.update([name])
            if found:
                said = f"{ended.code}: {ended.said} | {again.code}: {again.said}"
                tally.note(f"kill {number}, {words[:2]}, {name}", Ended(0, said, wrong=found))
            if rng.integers(3):
                shutil.rmtree(out)
        shutil.rmtree(out, ignore_errors=True)
    return tally


def fill(folder: Path, count: int, rng: np.random.Generator, _: Namespace) -> Tally:
    """Number of commands whose files may not grow beyond a random size, as on a full disk, or that print to one."""
    whole, log = folder / "campaign", folder / "log"
    out, tally = whole / OUT, Tally()
    for number in range(count):
        sample = WRITERS[number % len(WRITERS)]
        shutil.rmtree(out, ignore_errors=True)
        limit = int(2 ** rng.uniform(9, 20))
        onto_full = number // len(WRITERS) % 3 == 2

        def prepare(limit: int = limit, onto_full: bool = onto_full) -> None:
            if onto_full:
                os.dup2(os.open("/dev/full", os.O_WRONLY), 1)
            else:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        ended = waited(started(Trial(sample.words(whole), prepare), log), log)
        left = [path for path in out.rglob("*") if path.is_file()] if out.exists() else []
        wrong = {
            "unfinished files": any(".part/" in str(path) for path in left),
            "a file that is not whole": any(not path.stat().st_size for path in left)
            or bool(_damaged(list(out.rglob("*.h5")))),
        }
        found = [what for what, is_so in wrong.items() if is_so]
        tally.note(
            f"full {number}, {sample.command}, {'/dev/full' if onto_full else limit}",
            Ended(ended.code, ended.said, wrong=found),
        )
    shutil.rmtree(out, ignore_errors=True)
    return tally


def meet(folder: Path, count: int, rng: np.random.Generator, _: Namespace) -> Tally:
    """Number of pairs of runs in one folder, one a moment later: it is refused in one line, or makes the same."""
    whole = folder / "campaign"
    out, logs, tally = whole / OUT, (folder / "log", folder / "log2"), Tally()
    for sample in WRITERS[:2]:
        shutil.rmtree(out, ignore_errors=True)
        words = sample.words(whole)
        begun = time.monotonic()
        tally.note("before", waited(started(Trial(words), logs[0]), logs[0]))
        lasts, expected = time.monotonic() - begun, _contents(out)
        for number in range(-(-count // 2)):
            if number % 2:
                shutil.rmtree(out)
            first = started(Trial(words), logs[0])
            time.sleep(rng.uniform(0, lasts))
            second = started(Trial(words), logs[1])
            ended = [waited(child, log) for child, log in zip((first, second), logs, strict=True)]
            refused = [one for one in ended if one.code]
            wrong = ["both were refused"] if len(refused) == 2 else []
            if any("another run is writing into this folder" not in one.said for one in refused):
                wrong.append("refused otherwise")
            if _contents(out) != expected:
                wrong.append("other bytes")
            tally.seen.update(["one was refused" if refused else "both had their turn"])
            if wrong:
                tally.note(f"pair {number}", Ended(0, " | ".join(one.said for one in ended), wrong=wrong))
    shutil.rmtree(out, ignore_errors=True)
    return tally


def _contents(folder: Path) -> dict[str, bytes]:
    files = sorted(path for path in folder.rglob("*") if path.is_file()) if folder.exists() else []
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def _damaged(files: list[Path]) -> list[str]:
    """One line for each file whose checksums do not hold."""
    return [f"accepted: {failure}" for file in files for failure in check_file(file)[1][:1]]


def _pieces(path: Path) -> list[tuple[int, int]]:
    """Places and lengths of all numbers that a file stores."""
    found: list[tuple[int, int]] = []

    def note(_: str, node: h5py.Group | h5py.Dataset) -> None:
        if isinstance(node, h5py.Dataset) and node.chunks and node.dtype.kind != "O":
            node.id.chunk_iter(lambda piece: found.append((piece.byte_offset, piece.size)))

    with h5py.File(path) as file:
        file.visititems(note)
    return found
