"""The report of a study of one's own: what was run, its claims, the gap against the distance, success, and other levels.

``reading`` reads the tables of a results folder and ``study.yaml``, in which ``segar study`` writes what the study asks;
``claims`` tests its claims, ``figures`` and ``document`` have its figures and its text, ``segar.analysis.report.make`` puts
all together. The statistics, and the rules by which claims are decided, are those of the paper's report. All runs on one level
set stay together: where agents share level sets, a level set and not an agent is the unit.
"""
