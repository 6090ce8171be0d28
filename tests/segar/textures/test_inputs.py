"""Where the features of textures come from: columns of the state, markers, entity types, noise."""

import numpy as np
import pytest

import segar
from segar.language import Charge, GoalTile, GolfBall, Heat, Mass
from segar.textures import TextureSet, type_inputs


class Temperature(Heat, default=20.0):
    """A heat of its own."""


class Comet(segar.language.Thing):
    temperature: Temperature = 300.0


class Ember(segar.Tile):
    """A tile has a heat already, so this has two."""

    temperature: Temperature = 300.0


def a_set(*inputs) -> TextureSet:
    n = len(inputs)
    blank = np.zeros((1, n, 3, 3, 3))
    shift = np.array([1.0 if name == "Mass" else 0.0 for name in inputs])
    return TextureSet("mine", inputs, blank, blank[:, 0], shift, np.full(n, 2.0))


def test_the_tables_say_of_levels_what_entities_say_of_themselves():
    levels = segar.family("objectsx3-hard").sample(4, seed=0, split="train")
    textures = a_set("background", "Heat", "Charge", "Mass", "Consumes", "GoalTile", "Collides", "noise_1")
    table = type_inputs(textures, levels.layout)
    for level in range(len(levels)):
        for slot, kind in enumerate(levels.types[level]):
            entity = levels.layout.types[kind]
            if kind < 0 or not issubclass(entity, segar.language.Thing):
                continue
            row, columns = levels.values[level, slot], levels.layout.columns
            values = {factor: row[columns[factor]] for factor in (Charge, Mass) if factor in entity.declared}
            wanted = textures.features(textures.values(entity(values)))
            read = np.where(table.columns[kind] >= 0, (row[table.columns[kind]] - textures.shift) * textures.scale, 0.0)
            np.testing.assert_allclose(np.where(table.columns[kind] >= 0, read, table.constants[kind]), wanted)


@pytest.mark.parametrize(
    ("entity", "shown", "value"), [(Comet, "Heat", 300.0), (Ember, "Heat", 0.0), (Ember, "Temperature", 300.0)]
)
def test_a_sub_class_of_a_factor_is_shown_where_the_factor_itself_is_missing(entity, shown, value):
    levels = segar.Levels.from_entities([[GolfBall(), GoalTile(), entity()]])
    table = type_inputs(a_set(shown), levels.layout)
    row = levels.layout.types.index(entity)
    assert levels.values[0, 2, table.columns[row, 0]] == value
    assert a_set(shown).values(entity())[0] == value


def test_a_hidden_input_reads_no_column_and_is_zero():
    layout = segar.family("objectsx1-hard").sample(1, seed=0, split="train").layout
    table = type_inputs(
        a_set("Charge", "GoalTile", "noise_1", "noise_2"), layout, hidden=[Charge, "GoalTile", "noise_1"]
    )
    assert (table.columns == -1).all() and (table.constants == 0).all()
    assert table.noise.tolist() == [-1, -1, -1, 1] and table.draws == 2  # the second noise keeps its draw


def test_inputs_that_are_not_shown_that_nobody_knows_or_that_have_two_components_are_refused():
    layout = segar.family("empty-easy").layout
    with pytest.raises(segar.SegarError, match=r"do not show 'Chrge', so it cannot be hidden. Did you mean 'Charge'"):
        type_inputs(a_set("Charge"), layout, hidden=["Chrge"])
    with pytest.raises(segar.SegarError, match=r"'Chargee' is neither a factor nor an entity type.*'Charge'"):
        type_inputs(a_set("Chargee"), layout)
    with pytest.raises(segar.SegarError, match="'Velocity' has two components"):
        a_set("Velocity").values(GolfBall())
