"""Radio channel sounding: from raw captures to impulse responses, DAPS and multipath components (MPCs).

Start here. Open recordings, process them, reconstruct the map, plot it::

    import erm
    import sounder

    jobs, failures = sounder.gather(["RX1.h5", "RX2.h5"], calibration="back-to-back.h5")
    outcome = sounder.process(jobs, "products")
    table, problems = erm.read_mpcs(outcome.products)
    environment, located = erm.reconstruct(erm.select(table))
    erm.plot_map(environment, table=located)

``run_campaign("campaign.toml")`` does all of this and writes a report. One position, stage by stage, in memory, here
with the recording of two paths that comes with the package:

>>> import sounder
>>> from sounder import shipped
>>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
>>> [job], failures = sounder.gather(recordings, calibration=b2b)
>>> deembedding = sounder.calibrate(job.b2b, job.recording)
>>> cir, remarks = sounder.impulse_responses(job.recording, deembedding)
>>> spectrum = sounder.daps(cir, job.recording.sounder)
>>> mpcs = sounder.extract_mpcs(cir, deembedding, job.recording.sounder)
>>> mpcs.sizes["mpc"]
2

``simulate`` makes recordings of a scene with known paths, ``score`` compares MPCs with these paths, and ``cramer_rao``
gives the smallest standard deviations that any estimator can reach.

A file that cannot be used raises ``DataError`` with one line: the file, what is there, what was expected, what to do.
Each name is imported when it is first used, so that ``import sounder`` is fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from erm.common.version import __version__

if TYPE_CHECKING:
    from erm.common.errors import DataError
    from sounder.campaign.description import load_campaign
    from sounder.campaign.run import run_campaign
    from sounder.cir.impulse_response import calibrate, impulse_responses
    from sounder.cir.power_spectrum import daps
    from sounder.instrument.description import Sounder, load_sounder
    from sounder.mpc.cramer_rao import cramer_rao
    from sounder.mpc.extract import extract_mpcs
    from sounder.mpc.score import score
    from sounder.options import Options
    from sounder.parameters.statistics import campaign_statistics
    from sounder.processing.channel_parameters import channel_parameters
    from sounder.processing.jobs import gather
    from sounder.processing.pipeline import process
    from sounder.recordings.open import open_recordings
    from sounder.recordings.recording import BackToBack, Recording
    from sounder.twin.simulate import simulate

_MODULES = {
    "BackToBack": "sounder.recordings.recording",
    "DataError": "erm.common.errors",
    "Options": "sounder.options",
    "Recording": "sounder.recordings.recording",
    "Sounder": "sounder.instrument.description",
    "calibrate": "sounder.cir.impulse_response",
    "campaign_statistics": "sounder.parameters.statistics",
    "channel_parameters": "sounder.processing.channel_parameters",
    "cramer_rao": "sounder.mpc.cramer_rao",
    "daps": "sounder.cir.power_spectrum",
    "extract_mpcs": "sounder.mpc.extract",
    "gather": "sounder.processing.jobs",
    "impulse_responses": "sounder.cir.impulse_response",
    "load_campaign": "sounder.campaign.description",
    "load_sounder": "sounder.instrument.description",
    "open_recordings": "sounder.recordings.open",
    "process": "sounder.processing.pipeline",
    "run_campaign": "sounder.campaign.run",
    "score": "sounder.mpc.score",
    "simulate": "sounder.twin.simulate",
}
"""Module of each public name."""

__all__ = [
    "BackToBack",
    "DataError",
    "Options",
    "Recording",
    "Sounder",
    "__version__",
    "calibrate",
    "campaign_statistics",
    "channel_parameters",
    "cramer_rao",
    "daps",
    "extract_mpcs",
    "gather",
    "impulse_responses",
    "load_campaign",
    "load_sounder",
    "open_recordings",
    "process",
    "run_campaign",
    "score",
    "simulate",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    return __all__
