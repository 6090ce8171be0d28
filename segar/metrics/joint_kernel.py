"""The compiled search for the largest difference of two products of distribution functions."""

import numpy as np

from segar.support import cached

_options = {"nogil": True, "error_model": "numpy"}


@cached(**_options)
def largest_difference(f, g, ends):
    """max over x of prod_j f_j(x_j) - prod_j g_j(x_j), exactly.

    For any choice in the factors still to come, the difference is p P - q Q with p, q >= 0, linear in the products (P, Q)
    so far. So of all (P, Q), only those on the edge of their convex hull towards large P and small Q can win.

    Args:
        f, g: float64 ``[points]``, the curves one after another, each ascending in both.
        ends: int64 ``[curves]``, where each curve ends.
    """
    p, q = np.ones(1), np.ones(1)
    start = 0
    for end in ends:
        x, y = _edge(f[start:end], g[start:end], np.arange(end - start)[::-1])
        start = end
        if len(x) > 1 or x[0] != 1.0 or y[0] != 1.0:
            p, q = (np.outer(p, x).ravel(), np.outer(q, y).ravel())
            p, q = _edge(p, q, np.argsort(-p, kind="mergesort"))
    return (p - q).max()


@cached(**_options)
def _edge(x, y, order):
    """The vertices of the hull of points that maximise some a x - b y with a, b >= 0 (monotone chain); ``order`` is that
    of falling x."""
    chain, n, lowest = np.empty(len(x), np.int64), 0, np.inf
    for i in order:
        if y[i] >= lowest:  # a point further left that is not lower is never better
            continue
        lowest = y[i]
        if n and x[chain[n - 1]] == x[i]:
            n -= 1
        while n > 1 and _turns_inwards(x, y, chain[n - 2], chain[n - 1], i):
            n -= 1
        chain[n] = i
        n += 1
    return x[chain[:n]], y[chain[:n]]


@cached(**_options)
def _turns_inwards(x, y, a, b, c):
    return (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]) >= 0.0
