"""The columns, constants and compiler options that the hand-written kernels share."""

# As the generated kernels are compiled. Not cached: numba would not see that a number here has changed.
AS_KERNELS = {"error_model": "numpy", "nogil": True, "_nrt": False}

# Columns of ``body[env, i]`` ...
X, Y, VX, VY, AX, AY, DX, DY, MASS, RADIUS, CHARGE, MAGNETISM, ENERGY, KEEPS, MOBILE, ALIVE, DONE, VISIBLE = range(18)
# ... of ``goal[env]``, and of ``world[env]``.
GOAL_X, GOAL_Y, GOAL_RADIUS, GOAL_FRICTION, GOAL_HEAT = range(5)
GRAVITY, FLOOR_FRICTION, WALL_DAMPING, MIN_MASS, MAX_SPEED, MIN_SPEED, FRAMERATE = range(7)

TOUCH = 1e-7  # [m] closer than this counts as touching
AT_REST = 1e-6  # [m/s] slower than this nothing slides
IMMOVABLE = 1e8  # [kg] of what does not move
DIAGONAL = 8.0**0.5  # [m] of the arena
MAX_CONTACTS = 64  # of one sub-step
MAX_REWINDS = 256  # before one contact
MAX_PASSES = 50  # that push bodies apart once a sub-step has given up
