"""Questions about worlds: predict, plan, explain, counterfactual; made and graded by the simulator. No model is called.

The room plays levels by given actions. Other rooms use the names below.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
