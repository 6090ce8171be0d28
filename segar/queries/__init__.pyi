from .changes import (
    ActionChange as ActionChange,
    FactorChange as FactorChange,
    ParameterChange as ParameterChange,
    RuleChange as RuleChange,
)
from .files import read_answers, read_questions, write_questions
from .grading import Grades as Grades, grade
from .kinds import KINDS as KINDS
from .making import make_questions
from .question import Question as Question

__all__ = ["grade", "make_questions", "read_answers", "read_questions", "write_questions"]
