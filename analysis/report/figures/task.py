"""The picture of the task: a level of each family and difficulty of the main grid, as an agent could see it, but larger."""

import pandas as pd

from analysis.plotting import style
from analysis.plotting.figures import new_figure
from analysis.plotting.names import family_name
from analysis.renderings import first_frame
from analysis.report.claims.evidence import Evidence
from analysis.report.figures.drawing import Drawn
from segar.levels import family
from segar.observations import Pixels

PIXELS = 192
SEED = 3  # of levels that show what there is


def task(evidence: Evidence) -> Drawn | str:
    """A level of each panel of the main grid."""
    main = evidence.ungated.main
    if main.empty:
        return "there are no runs of the main grid"
    families, difficulties = style.ordered(main["family"]), style.ordered(main["difficulty"])
    figure = new_figure(2.1 * len(families) + 0.2, 2.2 * len(difficulties) + 0.1)
    rows = []
    for axes_row, difficulty in zip(
        figure.subplots(len(difficulties), len(families), squeeze=False), difficulties, strict=True
    ):
        for axes, name in zip(axes_row, families, strict=True):
            levels = family(f"{name}-{difficulty}").sample(1, seed=SEED)
            axes.imshow(first_frame(levels, Pixels(PIXELS)), interpolation="nearest")
            axes.set_axis_off()
            axes.set_title(f"{family_name(name)}, {difficulty}", fontsize=9)
            rows.append({"family": name, "difficulty": difficulty, "seed": SEED})
    return Drawn(figure, pd.DataFrame(rows))
