"""The paper's pictures, redrawn: whole pixels, and the panels that they should have."""

import matplotlib.image
import numpy as np
import pytest

from analysis import renderings
from analysis.renderings import MARGIN, RESOLUTION, TITLE_HEIGHT, ZOOM


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("renderings")
    renderings.run(folder / "new")
    return {path.stem: matplotlib.image.imread(path) for path in (folder / "new").iterdir()}


def test_one_call_draws_all_pictures(pictures):
    assert {name: picture.shape[1] // (RESOLUTION * ZOOM) for name, picture in pictures.items()} == {
        "tasks": 2,
        "features": 2,
        "feature_variants": 3,
    }


@pytest.mark.parametrize("name", ["tasks", "features"])
def test_every_pixel_of_a_frame_becomes_a_square(pictures, name):
    picture = np.rint(pictures[name][..., :3] * 255).astype(np.uint8)
    for k, (_, frame) in enumerate(getattr(renderings, name)()):
        left = MARGIN + k * (RESOLUTION * ZOOM + MARGIN)
        shown = picture[TITLE_HEIGHT : TITLE_HEIGHT + RESOLUTION * ZOOM, left : left + RESOLUTION * ZOOM]
        np.testing.assert_array_equal(shown, frame.repeat(ZOOM, axis=0).repeat(ZOOM, axis=1))


def test_variants_show_the_same_things_in_other_looks():
    frames = [frame for _, frame in renderings.variants()]
    outlines = [(frame == 0).all(axis=-1) for frame in frames]
    black = outlines[0] & outlines[1] & outlines[2]
    assert black.sum() > 300  # outlines stay where they are
    floor = np.stack([frame[:6, :6].reshape(-1) for frame in frames]).astype(float)
    for i in range(3):
        for j in range(i):
            assert np.abs(floor[i] - floor[j]).mean() > 30
