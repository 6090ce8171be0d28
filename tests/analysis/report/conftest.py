"""Reports of which the figures and the bootstraps, which take seconds, are not the point."""

import pytest

from segar.analysis.plotting.figures import new_figure, save_figure


@pytest.fixture
def undrawn(monkeypatch):
    monkeypatch.setattr("segar.analysis.report.claims.evidence.RESAMPLES", 100)
    monkeypatch.setattr("segar.analysis.report.document.files.save_figure", stand_in)


def stand_in(figure, path, suffixes):
    """An empty figure in place of one whose drawing takes long."""
    return save_figure(new_figure(1, 1), path, suffixes)
