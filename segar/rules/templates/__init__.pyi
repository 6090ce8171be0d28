from .changes import contagion as contagion, growth as growth, sharing as sharing, unlocking as unlocking
from .dynamics import dynamics_space as dynamics_space, law_space as law_space
from .forces import (
    anchor_spring as anchor_spring,
    central_force as central_force,
    drag as drag,
    magnetic_field as magnetic_field,
    pair_spring as pair_spring,
    rotating_field as rotating_field,
    uniform_field as uniform_field,
)
from .places import (
    drifting as drifting,
    hiding as hiding,
    one_way_wall as one_way_wall,
    portal as portal,
    switch as switch,
)
