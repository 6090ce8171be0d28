"""The report of a results folder: claims with verdicts, statistics, figures, one HTML page.

``make`` makes it, of the paper's experiments or of a study of one's own, from ``claims``, ``figures`` and ``document``;
``results`` reads the tables, and nothing else is read.
"""
