"""The picture of the task: a level of each family and difficulty of the main grid, as an agent could see it, but larger."""

from itertools import product

import pandas as pd

from analysis.plotting import style
from analysis.plotting.figures import PAGE_WIDTH, new_figure
from analysis.plotting.names import word_for
from analysis.renderings import first_frame
from analysis.report.claims.evidence import Evidence
from analysis.report.figures.drawing import Drawn
from segar.levels import family
from segar.observations import Pixels

PIXELS = 192
COLUMNS = 6  # of frames
SEED = 3  # of levels that show what there is


def task(evidence: Evidence) -> Drawn | str:
    """A level of each panel of the main grid."""
    main = evidence.ungated.main
    if main.empty:
        return "there are no runs of the main grid"
    families, difficulties = style.ordered(main["family"]), style.ordered(main["difficulty"])
    panels = list(product(families, difficulties))
    lines = -(-len(panels) // COLUMNS)
    figure = new_figure(PAGE_WIDTH, 1.85 * lines)
    places = list(figure.subplots(lines, COLUMNS, squeeze=False).flat)
    for axes in places:
        axes.set_axis_off()
    rows = []
    for axes, (name, difficulty) in zip(places, panels, strict=False):
        levels = family(f"{name}-{difficulty}").sample(1, seed=SEED)
        axes.imshow(first_frame(levels, Pixels(PIXELS)), interpolation="nearest")
        axes.set_title(f"{word_for(name)}, {difficulty}", fontsize=8.5)
        rows.append({"family": name, "difficulty": difficulty, "seed": SEED})
    return Drawn(figure, pd.DataFrame(rows))
