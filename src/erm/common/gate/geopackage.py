"""GeoPackages: what GDAL may open.

GDAL chooses the driver by the content of a file, whatever its name. Some of its drivers read other files or the network
(VRT), and SQL inside a database can do so too. Therefore a file must be a SQLite database that says it is a GeoPackage,
and must not hold SQL of its own but the tables and triggers that GeoPackage defines.
"""

import sqlite3
from contextlib import closing
from pathlib import Path

from erm.common.errors import DataError
from erm.common.gate.files import require_file
from erm.common.gate.limits import current, too_large

MAGIC = b"SQLite format 3\0"
APPLICATIONS = (b"GPKG", b"GP10", b"GP11")
"""Application numbers in the header of a GeoPackage, at byte 68 (OGC 12-128, requirement 2)."""
HEADER = 72
PREFIXES = ("gpkg_", "rtree_", "trigger_", "sqlite_")
"""First letters of the names of views and triggers that GeoPackage and its writers define."""


def require_geopackage(path: Path) -> None:
    """Refuse a file that GDAL would not open as a plain GeoPackage.

    Raises
    ------
    DataError
        It is no GeoPackage, is damaged or too large, or holds views or virtual tables of its own.
    """
    require_file(path)
    if path.stat().st_size > current().max_bytes:
        raise DataError(f"{path}: {too_large(path.stat().st_size)}")
    with path.open("rb") as file:
        header = file.read(HEADER)
    if not header.startswith(MAGIC) or header[HEADER - 4 :] not in APPLICATIONS:
        raise DataError(f"{path}: not a GeoPackage; export it again, or use .geojson")
    try:
        # immutable: neither locks nor files beside it
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as database:
            made = database.execute("SELECT type, name, sql FROM sqlite_master LIMIT 10000").fetchall()
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise DataError(f"{path}: damaged GeoPackage ({error}); make or copy it again") from None
    for kind, name, sql in made:
        virtual = kind == "table" and "virtual" in str(sql).lower().split()[:3]
        if (kind in ("view", "trigger") or virtual) and not str(name).startswith(PREFIXES):
            what = "virtual table" if virtual else kind
            raise DataError(f"{path}: holds a {what} {name}, which is not run; export its content as plain layers")
        if virtual and "using rtree" not in " ".join(str(sql).lower().split()):
            raise DataError(f"{path}: holds a virtual table {name}, which is not run; export plain layers")
