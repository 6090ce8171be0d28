from . import mathematics as mathematics
from .code_folder import (
    ADVICE as ADVICE,
    MACHINE_CODE as MACHINE_CODE,
    cache_folder as cache_folder,
    is_trusted as is_trusted,
    private_cache_folder as private_cache_folder,
    say_where_kept as say_where_kept,
)
from .command_line import (
    USAGE_ERROR as USAGE_ERROR,
    Parser as Parser,
    escape_what_cannot_be_printed as escape_what_cannot_be_printed,
)
from .compiled import PATIENCE as PATIENCE, cached as cached, keep_kernel as keep_kernel, patience as patience
from .counter_kernel import (
    GOLDEN as GOLDEN,
    keyed_uniform as keyed_uniform,
    mix as mix,
    normal as normal,
    uniform as uniform,
)
from .counter_rng import LevelGenerator as LevelGenerator, stream_key as stream_key
from .estimates import Estimate as Estimate
from .faces import lazy_face as lazy_face
from .files import (
    LOCK as LOCK,
    UNFINISHED as UNFINISHED,
    ArchiveFormat as ArchiveFormat,
    locked as locked,
    remove_unfinished as remove_unfinished,
    replacing as replacing,
)
from .imports import (
    EVERYTHING as EVERYTHING,
    ObjectName as ObjectName,
    has_pygame as has_pygame,
    installed_version as installed_version,
    made as made,
    module_in_file as module_in_file,
    named_object as named_object,
    named_or_made as named_or_made,
    need as need,
    need_pygame as need_pygame,
    object_name as object_name,
    resolve as resolve,
)
from .json_forms import (
    check_form as check_form,
    from_csv as from_csv,
    from_handwritten_json as from_handwritten_json,
    from_json as from_json,
    misfit as misfit,
    require_form as require_form,
    data_in as data_in,
    shown as shown,
)
from .kept_arrays import read_only as read_only, read_only_view as read_only_view
from .notebooks import ShownInNotebooks as ShownInNotebooks, templates as templates
from .npz import (
    damage_told as damage_told,
    Form as Form,
    first_line as first_line,
    open_npz as open_npz,
)
from .optimal_transport import emd as emd, plan_of as plan_of, pot as pot
from .published import (
    ADDRESS as ADDRESS,
    MANIFEST as MANIFEST,
    RESULTS as RESULTS,
    ROWS as ROWS,
    WORKSPACE as WORKSPACE,
    Published as Published,
    fetch_published as fetch_published,
    read_manifest as read_manifest,
    write_manifest as write_manifest,
)
from .parquet import read_table as read_table
from .reading import check_size as check_size, content_of as content_of, file_limit as file_limit, opened as opened
from .reading import sha256_of as sha256_of
from .text_table import aligned as aligned, counted as counted
from .threads import Team as Team, cores as cores
from .version import __version__ as __version__
from .whole_numbers import is_whole as is_whole
from .yaml_text import read_yaml as read_yaml

__all__ = []
