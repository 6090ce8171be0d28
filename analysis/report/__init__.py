"""The report of a results folder: claims with verdicts, statistics, figures, one HTML page and a PDF.

``make`` makes it, from ``claims``, ``figures`` and ``document``; ``results`` reads the tables, and nothing else is read.
"""
