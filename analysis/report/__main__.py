"""``python -m analysis.report results=FOLDER``: claims, statistics, figures and a page from the tables of a folder.

``FOLDER`` is one that experiments.reproduce made, or one of docs/results; only its tables are read. Written there:
``report.html``, ``claims.csv``, ``figures/<name>.{svg,png,csv}`` and ``statistics/<name>.csv``. ``pdf=true`` prints the page
into ``report.pdf``, too, where Chromium is installed. ``only=[figure_3a]`` draws figures and makes nothing else.
"""

from analysis.report.make import ReportConfig, main
from experiments.commands.command_line import run_from_command_line

if __name__ == "__main__":
    run_from_command_line(main, ReportConfig, __doc__)
