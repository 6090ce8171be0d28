"""World parameters: constants of the physics that a level may vary and a rule may take as arguments, by type."""

from segar.language.factors import Scalar


class Parameter(Scalar):
    """A number that belongs to the world, not to an entity; a distribution may draw it for each level."""


class Gravity(Parameter, default=10.0, unit="m/s^2", bounds=(0.0, 1e6)): ...


class FloorFriction(Parameter, default=0.05, bounds=(0.0, 1e6)):
    """Friction coefficient of the arena's floor, which acts everywhere."""


class WallDamping(Parameter, default=0.025, bounds=(0.0, 1.0)):
    """Share of the speed that a wall takes at each bounce."""


class MinMass(Parameter, default=0.1, unit="kg"):
    """Below this mass an object dies."""


class MaxVelocity(Parameter, default=10.0, unit="m/s", bounds=(0.0, 1e6)): ...


class MinVelocity(Parameter, default=1e-4, unit="m/s"):
    """Below this speed nothing moves.

    >>> segar.MinVelocity.default, segar.MinVelocity.unit
    (0.0001, 'm/s')
    """


class Framerate(Parameter, default=100.0, unit="1/s", bounds=(1e-3, 1e9)):
    """Sub-steps per second of simulated time; the time step is its inverse."""


BUILT_IN_PARAMETERS: tuple[type[Parameter], ...] = tuple(Parameter.__subclasses__())
