"""The paper's pictures, redrawn: the panels that they should have, and the looks that they should show."""

import matplotlib.image
import numpy as np

from segar.analysis import renderings


def test_one_call_draws_all_pictures(tmp_path):
    renderings.run(tmp_path / "new")
    shapes = {path.stem: matplotlib.image.imread(path).shape for path in (tmp_path / "new").iterdir()}
    ratios = {name: round(width / height) for name, (height, width, _) in shapes.items()}
    assert ratios == {"tasks": 2, "features": 2, "feature_variants": 3}


def test_variants_show_the_same_things_in_other_looks():
    frames = [frame for _, frame in renderings.variants()]
    outlines = [(frame == 0).all(axis=-1) for frame in frames]
    black = outlines[0] & outlines[1] & outlines[2]
    assert black.sum() > 300  # outlines stay where they are
    floor = np.stack([frame[:6, :6].reshape(-1) for frame in frames]).astype(float)
    for i in range(3):
        for j in range(i):
            assert np.abs(floor[i] - floor[j]).mean() > 30
