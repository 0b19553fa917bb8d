"""PNG files are read as what was written, by the reader that others have."""

import numpy as np
import pytest
from PIL import Image

from erm.common.png import png


@pytest.mark.parametrize("shape", [(1, 1, 3), (7, 300, 3), (200, 3, 4)])
def test_an_image_is_read_as_it_was(tmp_path, shape):
    image = np.random.default_rng(shape[0]).integers(0, 256, shape, np.uint8)
    path = tmp_path / "one.png"
    path.write_bytes(png(image, 160))
    with Image.open(path) as read:
        assert np.array_equal(np.asarray(read), image[..., :3])
        assert np.allclose(read.info["dpi"], 160, atol=0.0254 / 2)  # stored in whole points a metre
