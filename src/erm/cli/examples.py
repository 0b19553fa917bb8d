"""Examples that ``--help`` shows, by command."""

EXAMPLES = {
    "reconstruct": (
        "erm reconstruct products/*.h5 --out map.h5 --figure map.png",
        "erm reconstruct mpcs.csv --out map.geojson --rps points.csv",
        "erm reconstruct more.csv --add-to map.h5 --out larger.h5",
    ),
    "predict": ("erm predict map.h5 --tx 0 0 28.4 --rx 31 -60 1.4",),
    "letter": ("erm letter --out letter",),
    "evaluate": (
        "erm evaluate map.h5 products/*.h5 --outline truth.geojson --json",
        "erm evaluate map.h5 products/*.h5 --leave-one-out",
    ),
    "export": (
        "erm export map.h5 --out placed.h5 --origin 48.1 11.5",
        "erm export placed.h5 --out map.gpkg --crs EPSG:25832",
        "erm export map.h5 --out scene.xml",
    ),
}
