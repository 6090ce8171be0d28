"""The pictures of relations in the documentation show what the engine says today."""

import numpy as np
import pytest
from PIL import Image

from analysis.studies.relations import BALL, FOLDER, PICTURES, TILE, ask
from segar import Circle
from segar.language import Square

EDGES = {  # [m] distance along the x-axis of the last centre where the relation holds
    ("On", Circle): TILE / 2 + BALL / 2,
    ("On", Square): TILE / 2,
    ("Inside", Circle): TILE / 2 - BALL / 2,
    ("Inside", Square): TILE / 2 - BALL / 2,
}


@pytest.mark.parametrize(("relation", "shape"), EDGES, ids=str)
def test_a_relation_ends_where_the_page_says(relation, shape):
    edge = EDGES[relation, shape]
    places = np.array([[edge - 1e-5, 0.0], [edge + 1e-5, 0.0]])
    assert ask(shape(TILE), places)[relation].tolist() == [True, False]


@pytest.mark.parametrize("name", PICTURES)
def test_the_picture_of_the_page_is_the_one_that_is_drawn_today(name):
    with Image.open(FOLDER / f"{name}.png") as image:
        np.testing.assert_array_equal(np.asarray(image.convert("RGB")), PICTURES[name]())
