"""SEGAR: a sandbox for research on generalization in reinforcement learning.

Entities, factors, rules and priors make level distributions; levels are sampled from them, simulated by a kernel that
is compiled from the rules, and measured. See README.md for a first run.

Here stand the names that most programs need. All others stand in the rooms: ``segar.language`` (factors, entities,
parameters, shapes, relations, effects, mathematics of rules), ``segar.rules``, ``segar.noise``, ``segar.levels``,
``segar.tasks``, ``segar.observations``, ``segar.envs``, ``segar.metrics``, ``segar.textures``, ``segar.rendering``,
``segar.hardness``, ``segar.policies``, ``segar.evaluation``, ``segar.datasets``, ``segar.suites`` and ``segar.errors``.
"""

from segar import playground, tasks  # tasks sets the default task
from segar.envs import register_all
from segar.suites import register_suites
from segar.support import ShownInNotebooks, lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)

register_all()
register_suites()
ShownInNotebooks._repr_html_ = lambda shown: playground.html_of(shown)  # which is loaded when it is asked for
