"""The reference interpreter: the same rules as plain Python, which the kernels are held against."""

from segar.reference.interpreter import Interpreter
from segar.reference.reference_state import Firing, Result

__all__ = ["Firing", "Interpreter", "Result"]
