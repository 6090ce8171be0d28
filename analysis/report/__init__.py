"""The report: from the tables of a results folder to claims with verdicts, statistics, figures, one HTML page
and a PDF."""
