"""Examples that ``--help`` shows, by command."""

EXAMPLES = {
    "demo": ("sounder demo --out demo-output",),
    "simulate": ("sounder simulate uma.toml --out twin",),
    "info": (
        "sounder info RX1.h5",
        "sounder info P1.bin --layout iq_layout.toml",
        "sounder info products/RX1.h5 --json",
    ),
    "convert": ("sounder convert campaign.mat --layout layout.toml --out recordings",),
    "process": (
        "sounder process raw/*.h5 --calibration back-to-back.h5 --out products",
        "sounder process campaign.mat --layout layout.toml --threshold 12,25 --out products",
    ),
    "run": ("sounder run street.toml", "sounder run street.toml --watch"),
    "figures": (
        "sounder figures products/*.h5 --out figures --format pdf",
        "sounder figures products/RX1.h5 --elevations --out figures",
    ),
    "score": ("sounder score products/*.h5 --truth truth/paths.h5 --json",),
    "check": ("sounder check raw/*.h5", "sounder check products/*.h5 --json"),
    "parameters": (
        "sounder parameters products/*.h5 --statistics statistics.tex",
        "sounder parameters products/*.h5 --point-data point-data.csv",
        "sounder parameters products/*.h5 --threshold 12,25 --clusters k-power-means --out parameters.csv",
    ),
    "report": ("sounder report products/*.h5 --out report.html",),
    "verify": ("sounder verify artefacts.toml --out page.pdf --history history.csv",),
}
