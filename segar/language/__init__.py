"""The language in which a person writes worlds: values, factors, entities, relations, rules, tasks; and what reads it."""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
