"""Entropy of factors, exact where a law says it: what information about a factor is a fraction of."""

from dataclasses import dataclass

import numpy as np

from segar.analysis.probes.pairs import Column
from segar.analysis.tables import Floats, Ints
from segar.noise import Noise

BINS = 8  # log 8 = 2.08 nats for a law without atoms


@dataclass(frozen=True)
class Quantised:
    """A factor cut into cells: its value lies in cell k if ``edges[k - 1] < x <= edges[k]``.

    ``probabilities`` [cells] are the law's, exact; or, where ``source`` is "sample", shares among the frames at hand.
    """

    edges: Floats
    probabilities: Floats
    source: str

    @property
    def entropy(self) -> float:
        """Shannon entropy of the cell [nats]."""
        p = self.probabilities[self.probabilities > 0]
        return float(-(p * np.log(p)).sum())

    def cells(self, x: Floats) -> Ints:
        """The cell of each value; values must not be nan."""
        return np.searchsorted(self.edges, x, side="left")


def quantise(column: Column, values: Floats, bins: int = BINS) -> Quantised:
    """At most ``bins`` cells that are as likely as each other as far as atoms allow.

    For a factor that keeps its first value, the law decides cells and probabilities: a uniform or Gaussian factor has
    exactly log(bins) nats. One that changes in an episode has no law but what the agent makes of it, nor has one with a
    conditional prior: ``values`` (float [n], without nan) decide.
    """
    if column.law is not None and column.is_static:
        return quantise_law(column.law, bins, column.is_category)
    inner = np.unique(np.quantile(values, np.arange(1, bins) / bins, method="inverted_cdf"))
    edges = inner[inner < values.max()]
    counts = np.bincount(np.searchsorted(edges, values, side="left"), minlength=len(edges) + 1)
    return Quantised(edges, counts / counts.sum(), "sample")


def quantise_law(law: Noise, bins: int = BINS, every_atom: bool = False) -> Quantised:
    """The cells of a law on the line; ``every_atom``: one cell for each of its atoms, however many."""
    atoms = law.atoms[0]
    if every_atom or (len(atoms) <= bins and abs(law.atoms[1].sum() - 1) < 1e-9):
        edges = np.asarray(atoms[:-1], np.float64)
    else:
        inner = np.unique(np.asarray(law.icdf(np.arange(1, bins) / bins), np.float64))
        edges = inner[np.asarray(law.cdf(inner)) < 1 - 1e-12]
    at = np.concatenate([[0.0], np.asarray(law.cdf(edges), np.float64), [1.0]])
    return Quantised(edges, np.diff(at), "law")
