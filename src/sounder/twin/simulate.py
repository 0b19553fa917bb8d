"""A scene to files: raw recordings, their back-to-back recording, and the truth behind them."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from erm.common.errors import DataError
from erm.common.outputs import locked
from erm.common.storage import provenance, write_product
from erm.maps.environment import Environment, Slab
from erm.maps.formats import read_map, write_map
from erm.maps.materials import Material
from erm.tracing.trace import trace
from sounder import shipped
from sounder.instrument.touchstone import read_s21
from sounder.recordings.recording import BackToBack, Recording
from sounder.recordings.writer import write_back_to_back, write_recording
from sounder.twin.receiver import back_to_back, record
from sounder.twin.scene import Receiver, Scene, SceneEnvironment, load_scene


def environment_of(scene: Scene) -> Environment:
    """Environment of a scene: read from the file that it names, or built from what it draws.

    Raises
    ------
    DataError
        The file cannot be read, or a material is not known.
    """
    if scene.environment.file:
        return read_map(scene.environment.file)
    try:
        return _drawn(scene.environment)
    except DataError as error:
        raise DataError(f"{scene.name}: environment: {error}") from None


def _drawn(drawn: SceneEnvironment) -> Environment:
    pieces = [(segment, wall) for wall in drawn.walls for segment in wall.segments]
    environment = Environment.walls(
        np.array([segment for segment, _ in pieces]).reshape(-1, 2, 2),
        base=[wall.base for _, wall in pieces],
        top=[wall.top for _, wall in pieces],
        material=np.array([wall.material for _, wall in pieces], dtype=str),
        ground=drawn.ground and Slab(drawn.ground.height, drawn.ground.material),
        ceiling=drawn.ceiling and Slab(drawn.ceiling.height, drawn.ceiling.material),
        materials={name: Material.from_dict({"name": name} | given) for name, given in drawn.materials.items()},
    )
    if not drawn.poles:
        return environment
    return environment.with_poles(
        [pole.position for pole in drawn.poles],
        [pole.radius for pole in drawn.poles],
        base=[pole.base for pole in drawn.poles],
        top=[pole.top for pole in drawn.poles],
        material=np.array([pole.material for pole in drawn.poles], dtype=str),
    )


def trace_scene(scene: Scene, environment: Environment) -> list[xr.Dataset]:
    """Trace the paths to each receiver of a scene, with `erm.tracing.trace.trace`.

    Raises
    ------
    DataError
        A position states ``los``, and the environment contradicts it.
    """
    frequency = scene.sounder.carrier.frequency
    found = []
    for receiver in scene.receivers:
        tx = scene.transmitters[receiver.tx]
        paths = trace(environment, tx, receiver.position, frequency, max_order=scene.max_order)
        _require_line_of_sight(scene, receiver, paths)
        found.append(paths)
    return found


def record_scene(scene: Scene, traced: Sequence[xr.Dataset]) -> Iterator[Recording]:
    """Record each position of a scene from its traced paths; the captures are computed when they are read."""
    for receiver, paths in zip(scene.receivers, traced, strict=True):
        yield record(
            paths,
            scene.sounder,
            name=receiver.name,
            tx_position=scene.transmitters[receiver.tx],
            rx_position=receiver.position,
            snapshots=scene.snapshots,
            los=int(paths["los"].any()),
            faults=scene.faults,
            seed=scene.seed,
        )


def _require_line_of_sight(scene: Scene, receiver: Receiver, paths: xr.Dataset) -> None:
    los = bool(paths["los"].any())
    if receiver.los is not None and receiver.los != los:
        states = {True: "in line of sight", False: "not in line of sight"}
        raise DataError(
            f"{scene.name}: {receiver.name} is {states[los]} of {receiver.tx} in this environment, but los says "
            f"{states[receiver.los]}; move the receiver, change the walls, or remove los"
        )


def back_to_back_of(scene: Scene) -> BackToBack:
    """Back-to-back recording of the sounder of a scene, through its attenuator.

    Raises
    ------
    DataError
        The file of the attenuator cannot be read or does not cover the band of the sounder.
    """
    attenuator = scene.attenuator
    if isinstance(attenuator, float):
        return back_to_back(scene.sounder, attenuator, faults=scene.faults, seed=scene.seed)
    half = scene.sounder.bandwidth / 2
    band = scene.sounder.carrier.frequency - half, scene.sounder.carrier.frequency + half
    measured = read_s21(attenuator or shipped.calibration("attenuator-60db.s2p"), band=band)
    return back_to_back(scene.sounder, measured, faults=scene.faults, seed=scene.seed)


def simulate(scene: Scene | Path | str, out: Path | str, *, progress: Callable[[], None] | None = None) -> list[Path]:
    """Simulate the raw recordings of a scene and write them with their truth.

    Parameters
    ----------
    scene : Scene or path
        Environment, positions, sounder and faults: a scene file (TOML), or what
        :func:`sounder.twin.scene.load_scene` reads from one.
    out : path
        Folder; made if it is not there. It gets ``back-to-back.h5``, ``raw/NAME.h5`` for each position,
        ``truth/environment.geojson`` and ``truth/paths.h5``. The latter holds the paths of all positions along
        ``path``: the variables of :func:`erm.tracing.trace.trace` and ``position``.
    progress : callable, optional
        Called after each position.

    Returns
    -------
    list of Path
        The recordings, in the order of the scene.

    Raises
    ------
    DataError
        The scene cannot be read or contradicts its environment, or the folder cannot be written to.

    Examples
    --------
    One position of the shipped room, with one capture per direction:

    >>> import sounder, tempfile
    >>> from sounder import shipped
    >>> from sounder.twin.scene import load_scene
    >>> scene = load_scene(shipped.scene("lroom.toml"))
    >>> scene = scene.model_copy(update={"receivers": scene.receivers[:1], "snapshots": 1})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [file] = sounder.simulate(scene, folder)
    ...     print(file.name, sorted(path.name for path in file.parents[1].glob("*")))
    RX1.h5 ['back-to-back.h5', 'raw', 'truth']
    """
    scene, out = scene if isinstance(scene, Scene) else load_scene(scene), Path(out)
    with locked(out):
        return _simulate(scene, out, progress)


def _simulate(scene: Scene, out: Path, progress: Callable[[], None] | None) -> list[Path]:
    history = f"sounder simulate {scene.name}"
    environment, b2b = environment_of(scene), back_to_back_of(scene)
    traced = trace_scene(scene, environment)
    write_back_to_back(b2b, out / "back-to-back.h5", history=history)
    sources = [scene.environment.file] if scene.environment.file else []
    environment.reflectors.attrs.update(provenance("Simulated environment", history, inputs=sources))
    write_map(environment, out / "truth" / "environment.geojson")
    recordings: list[Path] = []
    truth: list[xr.Dataset] = []
    for recording, paths in zip(record_scene(scene, traced), traced, strict=True):
        target = out / "raw" / f"{recording.name}.h5"
        write_recording(recording, target, history=history)
        truth.append(paths.assign(position=("path", np.full(paths.sizes["path"], recording.name))))
        recordings.append(target)
        if progress is not None:
            progress()
    joined = xr.concat(truth, dim="path")
    origin = provenance("Traced propagation paths of all positions", history, options=_options(scene))
    joined.attrs = origin | {"frequency": scene.sounder.carrier.frequency}
    write_product({"/": joined}, out / "truth" / "paths.h5")
    return recordings


def _options(scene: Scene) -> dict[str, object]:
    kept = {"snapshots", "seed", "max_order", "faults"}
    return scene.model_dump(mode="json", include=kept)
