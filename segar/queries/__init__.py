"""Questions about worlds: predict, plan, explain, counterfactual; made and graded by the simulator. No model is called.

The room plays levels by given actions. Other rooms use the names below.
"""

from segar.queries.changes import ActionChange, Change, FactorChange, ParameterChange, RuleChange
from segar.queries.files import read_answers, read_questions, write_questions
from segar.queries.grading import Grades, grade
from segar.queries.kind import Mark
from segar.queries.making import KINDS, make_questions
from segar.queries.question import Question

__all__ = [
    "KINDS", "ActionChange", "Change", "FactorChange", "Grades", "Mark", "ParameterChange", "Question", "RuleChange",
    "grade", "make_questions", "read_answers", "read_questions", "write_questions",
]  # fmt: skip
