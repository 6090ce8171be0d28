"""Small tools that every room may use: whole-file writes, optional packages, threads, counter-based random numbers,
elementary functions.

The room imports ``errors`` alone. Others use the names that are imported here.
"""

from segar.support import mathematics
from segar.support.compiled import cached, keep_beside
from segar.support.counter_kernel import GOLDEN, SPACING, keyed_uniform, mix, normal, uniform
from segar.support.counter_rng import LOW_WORD, SPARE_BITS, WORD, LevelGenerator, philox, stream_key
from segar.support.estimates import Estimate
from segar.support.files import LOCK, UNFINISHED, ArchiveFormat, locked, remove_unfinished, replacing
from segar.support.imports import (
    has_pygame,
    installed_version,
    made,
    module_in_file,
    named_object,
    named_or_made,
    need,
    need_pygame,
)
from segar.support.json_forms import from_json, misfit, read_handwritten_json, shown, with_line
from segar.support.moved_modules import deprecated_names, find_moved
from segar.support.npz import DAMAGE, LIMIT_VARIABLE, Form, check_size, file_limit, first_line, open_npz
from segar.support.optimal_transport import emd, plan_of, pot
from segar.support.plain import is_plain
from segar.support.text_table import aligned
from segar.support.threads import Team
from segar.support.version import __version__
from segar.support.whole_numbers import is_whole
