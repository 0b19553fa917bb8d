"""What all benchmarks share: captures to work on, interleaved timing, the table and its last line.

Import it before numpy.
"""

import pools  # isort: skip  # noqa: F401

import json
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

Captures = npt.NDArray[np.int16]

# Recurrences s[n + order] = sum of s[n + tap] (mod 2), one primitive polynomial an order.
TAPS = {9: (0, 4), 10: (0, 3), 11: (0, 2), 12: (0, 1, 4, 6), 13: (0, 1, 3, 4), 14: (0, 1, 3, 5), 15: (0, 1)}


class Time(NamedTuple):
    """Medians over rounds, in seconds."""

    wall: float
    processor: float


def sequence(order: int, taps: tuple[int, ...] | None = None) -> npt.NDArray[np.int8]:
    """One period of an m-sequence as 0 and 1."""
    chips = [0] * (order - 1) + [1]
    for n in range((1 << order) - 1 - order):
        chips.append(sum(chips[n + tap] for tap in taps or TAPS[order]) % 2)
    return np.array(chips, np.int8)


def recording(template: npt.NDArray[np.float64], directions: int, snapshots: int, seed: int = 1) -> Captures:
    """Captures (direction, snapshot, sample, 2) of four echoes in noise."""
    rng = np.random.default_rng(seed)
    clean = sum(
        gain * np.roll(template, delay) for delay, gain in ((10, 1500), (17, 600j), (40, -300 + 150j), (133, 75))
    )
    iq = np.empty((directions, snapshots, template.size, 2), np.int16)
    for captures in iq:
        noise = rng.standard_normal((snapshots, template.size, 2), np.float32) * np.float32(300)
        captures[..., 0] = np.rint(noise[..., 0] + clean.real)
        captures[..., 1] = np.rint(noise[..., 1] + clean.imag)
    return iq


@njit(nogil=True)
def read(words: npt.NDArray[np.int64]) -> int:
    """Read all words and do next to nothing with them: the floor that no processing goes below."""
    folded = 0
    for k in range(words.size):
        folded ^= words[k]
    return folded


def interleaved(
    candidates: dict[str, Callable[[], object]],
    rounds: int = 15,
    at_least: float = 0.02,
    threads: dict[str, int] | None = None,
) -> dict[str, Time]:
    """Time each candidate once a round, in turns, so that a busy machine is busy for all of them.

    Where wall time counts, ``threads`` says how many processors a candidate keeps busy; rounds in which it did not get
    nine tenths of them do not count, and at most twenty times as many rounds are tried.
    """
    repeats = {}
    for name, run in candidates.items():
        run()
        start = time.perf_counter()
        run()
        repeats[name] = max(1, int(at_least / (time.perf_counter() - start)))
    samples: dict[str, list[tuple[float, float]]] = {name: [] for name in candidates}
    for round_ in range(rounds if threads is None else 20 * rounds):
        for name in list(candidates)[:: 1 if round_ % 2 else -1]:
            if len(samples[name]) == rounds:
                continue
            wall, processor = time.perf_counter(), time.process_time()
            for _ in range(repeats[name]):
                candidates[name]()
            wall, processor = time.perf_counter() - wall, time.process_time() - processor
            if threads is None or processor >= 0.9 * threads[name] * wall:
                samples[name].append((wall / repeats[name], processor / repeats[name]))
    if any(len(pairs) < min(5, rounds) for pairs in samples.values()):
        raise SystemExit("the machine is too busy to measure wall time; run again when it is not")
    return {name: Time(*np.median(pairs, axis=0).tolist()) for name, pairs in samples.items()}


def table(times: dict[str, Time], captures: dict[str, int], ours: str) -> None:
    """Print microseconds a capture, and how many times longer than ours."""
    print(f"{'':44s} {'wall us':>9s} {'CPU us':>9s} {'CPU, ours = 1':>14s}")
    own = times[ours].processor / captures[ours]
    for name, spent in times.items():
        wall, processor = spent.wall / captures[name], spent.processor / captures[name]
        print(f"{name:44s} {wall * 1e6:9.3f} {processor * 1e6:9.3f} {processor / own:14.2f}")


def conclude(claim: str, ratio: float, floor_ratio: float | None) -> None:
    """Print the last line.

    ``ratio`` is the competitor's time over ours; ``floor_ratio`` is our time over that of reading the same bytes.
    """
    print(json.dumps({"claim": claim, "ratio": round(ratio, 3), "floor_ratio": floor_ratio and round(floor_ratio, 3)}))
