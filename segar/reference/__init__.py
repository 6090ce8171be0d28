"""The reference interpreter: the same rules as plain Python, which the kernels are held against."""

from segar.reference.interpreter import Interpreter
from segar.reference.result import Firing, Result

__all__ = ["Firing", "Interpreter", "Result"]
