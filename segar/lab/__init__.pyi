from .baselines import BASELINES as BASELINES, grade_baselines, read_grades as read_grades
from .grading import Grader
from .hidden_world import Lab
from .session import Session

__all__ = ["Grader", "Lab", "Session", "grade_baselines"]
