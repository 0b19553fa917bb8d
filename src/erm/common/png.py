"""PNG files of drawings.

Encoders try five filters on each row, for photographs. Of drawings, whose rows are mostly white, deflate alone makes
smaller files, in half the time.

References
----------
W3C, "Portable Network Graphics (PNG) Specification", third edition, 2025.
"""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

LEVEL = 3
"""Of deflate. The default level takes longer, for files that are hardly smaller."""


def png(image: NDArray[np.uint8], dpi: float) -> bytes:
    """Encode an opaque image.

    Parameters
    ----------
    image : array (row, column, 3 or 4)
        Red, green, blue; what follows is not stored.
    dpi : float
        Resolution [1/inch].
    """
    height, width = image.shape[:2]
    rows = np.zeros((height, 1 + 3 * width), np.uint8)  # a row begins with its filter, 0 for none
    rows[:, 1:] = image[..., :3].reshape(height, -1)
    metre = round(dpi / 0.0254)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        (
            _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
            _chunk(b"pHYs", struct.pack(">IIB", metre, metre, 1)),
            _chunk(b"IDAT", zlib.compress(rows.tobytes(), LEVEL)),
            _chunk(b"IEND", b""),
        )
    )


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
