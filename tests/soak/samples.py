"""A small campaign with a file in every format that is read, and the command lines that read each."""

import io
import tarfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from scipy.io import savemat

from ..sounder.cli.commands import LAYOUT, SCENE, SOUNDER

OUT = "out"
"""Folder of all that the command lines write."""
SECONDS = {"sounder run": 4.0, "sounder verify": 1.5, "sounder report": 1.0, "erm reconstruct": 1.0} | {
    "sounder process": 0.4
}
"""Processor time of commands that take more than a tenth of a second for these files."""
CAMPAIGN = """
[recordings]
files = ["raw/*.h5"]
calibration = "back-to-back.h5"
[processing]
workers = 1
[map]
min_support = 1
formats = ["h5", "geojson"]
[figures]
positions = "none"
"""
VERIFICATION = """
name = "of the soak"
date = 2026-03-01
calibration = "back-to-back.h5"
[[artefacts]]
name = "attenuator"
kind = "connected"
recordings = ["back-to-back.h5"]
s21 = "attenuator.s2p"
"""
ROW = """
[captures]
dataset = "samples"
axes = ["azimuth", "elevation", "snapshot", "sample"]
flat = true
[grid]
azimuth = [0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330]
elevation = [-15, 15]
[positions]
tx = [4.0, 5.0, 3.0]
rx = [12.0, 3.0, 1.5]
"""
TABLE_OF_POSITIONS = """
[positions.table]
name = "pos"
tx = ["te", "tn", "tu"]
rx = ["re", "rn", "ru"]
los = "los"
"""


@dataclass(frozen=True)
class Sample:
    """A file, and a command line that reads it; words that begin with ``@`` are files of the campaign."""

    file: str
    command: str

    @property
    def seconds(self) -> float:
        """Processor time of the command line, roughly [s]."""
        return SECONDS.get(" ".join(self.command.split()[:2]), 0.1)

    def words(self, folder: Path) -> list[str]:
        """Command line with paths in a copy of the campaign."""
        return [str(folder / word[1:]) if word.startswith("@") else word for word in self.command.split()]


PROCESS = f"sounder process {{}} --calibration @back-to-back.h5 --threads 1 --out @{OUT}"
RECORDING, B2B, PRODUCT, SIGMF = "raw/RX1.h5", "back-to-back.h5", "products/RX1.h5", "formats/p.sigmf"
SAMPLES = [
    *(
        Sample(RECORDING, command.replace("{}", f"@{RECORDING}"))
        for command in (PROCESS, "sounder info {}", "sounder check {}", f"sounder convert {{}} --out @{OUT}/c.h5")
    ),
    Sample(B2B, PROCESS.replace("{}", f"@{RECORDING}")),
    Sample(B2B, f"sounder info @{B2B}"),
    Sample("attenuator.s2p", f"sounder verify @verification.toml --out @{OUT}/v.png --history @{OUT}/v.csv"),
    Sample("verification.toml", "sounder verify @verification.toml"),
    Sample("sounder.toml", PROCESS.replace("{}", f"@{RECORDING}") + " --sounder @sounder.toml"),
    Sample("horn.csv", PROCESS.replace("{}", f"@{RECORDING}") + " --sounder @cut.toml"),
    Sample("scene.toml", f"sounder simulate @scene.toml --out @{OUT}"),
    Sample("campaign.toml", f"sounder run @campaign.toml --out @{OUT}"),
    Sample("formats/all.h5", f"sounder process @formats/all.h5 --layout @formats/layout.toml --threads 1 --out @{OUT}"),
    *(
        Sample(f"formats/{file}", f"sounder convert @formats/{data} --layout @formats/{layout} --out @{OUT}")
        for data, layout, files in (
            ("all.h5", "layout.toml", ("all.h5", "layout.toml")),
            ("all.mat", "layout.toml", ("all.mat",)),
            ("packed.mat", "layout.toml", ("packed.mat",)),
            ("row.bin", "row.toml", ("row.bin", "row.bin.toml")),
            ("row.iq.tar", "row.toml", ("row.iq.tar",)),
            ("all.h5", "table.toml --positions @formats/places.csv", ("places.csv",)),
        )
        for file in files
    ),
    *(Sample(f"{SIGMF}-{part}", f"sounder convert @{SIGMF}-meta --out @{OUT}/c.h5") for part in ("meta", "data")),
    Sample(f"{SIGMF}-meta", PROCESS.replace("{}", f"@{SIGMF}-meta")),
    *(
        Sample(PRODUCT, command.replace("{}", f"@{PRODUCT}"))
        for command in (
            "sounder info {}",
            "sounder check {}",
            f"sounder parameters {{}} --out @{OUT}/p.csv --from pdp",
            f"sounder report {{}} --out @{OUT}/r.html",
            f"erm reconstruct {{}} @products/RX2.h5 --out @{OUT}/m.h5 --min-support 1",
        )
    ),
    Sample("truth/paths.h5", f"sounder score @{PRODUCT} --truth @truth/paths.h5"),
    Sample("mpcs.csv", f"erm reconstruct @mpcs.csv --out @{OUT}/m.geojson --rps @{OUT}/r.csv --min-support 2"),
    Sample("mpcs.csv", f"sounder parameters @mpcs.csv --statistics @{OUT}/s.csv"),
    *(Sample(f"map.{kind}", f"erm export @map.{kind} --out @{OUT}/m.dxf") for kind in ("h5", "geojson", "gpkg", "csv")),
    Sample("map.h5", f"erm reconstruct @mpcs.csv --add-to @map.h5 --out @{OUT}/m.h5"),
    Sample("map.geojson", "erm evaluate @map.h5 --outline @map.geojson"),
    Sample("map.geojson", "erm predict @map.geojson --tx 4 5 3 --rx 12 3 1.5"),
]


def make_campaign(folder: Path, run: Callable[[list[str]], int]) -> None:
    """Write a file of each format, by the commands where they write it."""
    folder.mkdir(parents=True)
    texts = {
        "sounder": SOUNDER,
        "scene": SCENE.replace("60.0", '"attenuator.s2p"'),
        "campaign": CAMPAIGN,
        "verification": VERIFICATION,
    }
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text)
    lines = [f"{frequency:.3e} 0 0 1e-3 0 1e-3 0 0 0\n" for frequency in np.linspace(131e9, 133e9, 21)]  # 60 dB
    (folder / "attenuator.s2p").write_text("# Hz S RI R 50\n" + "".join(lines))
    cut = [f"{angle},{gain},{gain}\n" for angle in range(-180, 181, 5) for gain in [max(-12 * (angle / 30) ** 2, -35)]]
    (folder / "horn.csv").write_text("angle,azimuth,elevation\n" + "".join(cut))
    antenna = 'gain = 15\npattern = "cut"\ncut = "horn.csv"\n'
    (folder / "cut.toml").write_text(SOUNDER.replace("gain = 15\n", antenna))

    def made(command: str) -> None:
        assert run(Sample("", command).words(folder)) in (0, 1), command

    made("sounder simulate @scene.toml --out @.")
    made("sounder process @raw/RX1.h5 @raw/RX2.h5 --calibration @back-to-back.h5 --threads 1 --out @products")
    made("sounder parameters @products/RX1.h5 @products/RX2.h5 --mpcs @mpcs.csv")
    for kind in ("h5", "geojson", "gpkg", "csv"):
        made(f"erm reconstruct @products/RX1.h5 @products/RX2.h5 --min-support 1 --out @map.{kind}")
    (folder / "formats").mkdir()
    made(f"sounder convert @{RECORDING} --out @{SIGMF}-meta")
    _foreign(folder)


def _foreign(folder: Path) -> None:
    """The first recording and the back-to-back in formats of others."""
    with h5py.File(folder / RECORDING) as file, h5py.File(folder / B2B) as back_to_back:
        content = {name: file[name][()] for name in ("azimuth", "elevation", "tx_position", "rx_position", "agc_gain")}
        content |= {"iq": file["iq"][()][None], "b2b": back_to_back["iq"][()]}
        scales = {"iq": float(file["iq"].attrs["scale_factor"]), "b2b": float(back_to_back["iq"].attrs["scale_factor"])}
    content["agc_gain"] = content["agc_gain"][None]
    formats = folder / "formats"
    with h5py.File(formats / "all.h5", "w") as file:
        for name, values in content.items():
            file[name] = values
        for name, scale in scales.items():
            file[f"{name}_scale"] = scale
    for name, packed in (("all", False), ("packed", True)):
        savemat(
            formats / f"{name}.mat",
            content | {f"{name}_scale": scale for name, scale in scales.items()},
            do_compression=packed,
        )
    layout = LAYOUT
    for name in scales:
        layout = layout.replace(f'{{ attribute = "scale_factor", of = "{name}" }}', f'{{ dataset = "{name}_scale" }}')
    described = SOUNDER[SOUNDER.index("[waveform]") :].partition("[scan]")[0]  # the scan is the grid
    described = described.replace("[", "[sounder.").replace("= [sounder.", "= [")
    described = described.replace("gain = 15\n", 'gain = 15\npattern = "gaussian"\n')
    layout += described
    (formats / "layout.toml").write_text(layout)
    places = layout.index("[positions]"), layout.index("[back_to_back]")
    (formats / "table.toml").write_text(
        layout[: places[0]] + '[positions]\nname = "P{}"\n' + TABLE_OF_POSITIONS + layout[places[1] :]
    )
    (formats / "places.csv").write_text("pos,te,tn,tu,re,rn,ru,los\nP0,4,5,3,12,3,1.5,1\n")
    (formats / "row.toml").write_text(f"scale_factor = {scales['iq']}\n{ROW}{described}")
    gains = content["agc_gain"][0, :, :, None, None, None]  # a row of plain numbers does not tell them
    samples = (content["iq"][0] / 10 ** (gains / 20)).astype("<f4").tobytes()
    (formats / "row.bin").write_bytes(samples)
    (formats / "row.bin.toml").write_text('dtype = "float32"\nsamples = "complex"\n')
    tags = f"<Samples>{len(samples) // 8}</Samples><Clock>1.2e9</Clock><Format>complex</Format>"
    tags += "<DataType>float32</DataType><ScalingFactor>1</ScalingFactor><DataFilename>d.float32</DataFilename>"
    with tarfile.open(formats / "row.iq.tar", "w") as archive:
        for name, data in (
            ("d.float32", samples),
            ("d.xml", f"<RS_IQ_TAR_FileFormat>{tags}</RS_IQ_TAR_FileFormat>".encode()),
        ):
            member = tarfile.TarInfo(name)
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
