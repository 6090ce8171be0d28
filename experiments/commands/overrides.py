"""The overrides of a command line: which runs a sweep consists of, and which override is wrong and why."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Glob, Override, Quote, QuotedString
from hydra.errors import CompactHydraException, MissingConfigException
from omegaconf import OmegaConf

from segar.errors import did_you_mean
from segar.experiments.commands.config_store import WITH_OPTIONS, register_own
from segar.experiments.settings import (
    OWN_CLASSES,
    TARGET,
    ConfigError,
    hand_on_password,
    is_level_file,
    path_of,
    require,
    without_files,
)
from segar.suites import suites
from segar.support import first_line, object_name

MOST_RUNS = 100_000  # of a sweep or a grid; the largest of the paper has some hundreds
SEARCH_PATH = "hydra.searchpath"
# The setting that takes the name of an own object where a group of choices is given one.
OWN_NAMES = {"levels": "levels.train", "task": "task.name", "observation": "observation.name"}
SUITE, FRAMES = "suite", "scale.frames"
# One value of a list with commas between them, which may be in quotation marks.
VALUE = re.compile(r"""\s*'(?:[^'\\]|\\.)*'\s*|\s*"(?:[^"\\]|\\.)*"\s*|[^,]+""")
# A text in quotation marks or braces, or one that stands between commas and brackets.
BETWEEN_MARKS = re.compile(r"""'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*"|\{.*\}|[^,()\[\]='"{]+""")
# Further settings that may name an own object.
OWN_SETTINGS = (
    "levels.test", "levels.design", "levels.variation", "levels.test_variation", "levels.world", "algorithm.encoder",
    "policy",
)  # fmt: skip


def with_own_names(overrides: Sequence[str]) -> list[str]:
    """The overrides with ``levels.train=my_lab.levels:windy`` for ``levels=my_lab.levels:windy``, and so for tasks and
    observations, in sweeps too; ``file.py:attribute`` becomes ``module:attribute``, and ``levels=file.npz`` names its content.

    An algorithm or a curriculum of the user's own is made known to Hydra, with the defaults of its settings.

    Raises:
        ConfigError: a file does not exist, or what is named as an algorithm or a curriculum is none.
    """
    require_one_name(overrides)
    return [BETWEEN_MARKS.sub(_with_quoted_letters, _with_own_name(text)) for text in overrides]


def _with_quoted_letters(found: re.Match[str]) -> str:
    """A text such as ``Größe`` in quotation marks, because Hydra's grammar has no place for its letters; others as they are."""
    text = found[0].strip()
    return found[0] if text.isascii() or text[0] in "'\"{" or "\\" in text else found[0].replace(text, quoted(text))


def require_one_name(overrides: Sequence[str]) -> None:
    """Raises :class:`ConfigError` where a group of choices gets a list, or two names, of which one would count."""
    setting_of = {**OWN_NAMES, SUITE: OWN_NAMES["levels"]}  # a suite names the levels
    named: dict[str, str] = {}
    for text in overrides:
        key, equals, value = text.partition("=")
        group = key.lstrip("+")
        if not equals or group not in {*setting_of, *setting_of.values(), *OWN_CLASSES}:
            continue
        if value.startswith("[") and "." not in group:
            raise ConfigError(f"{group}: takes one name, not the list {value}; --multirun {group}=A,B is a run each")
        setting = setting_of.get(group, group)
        if setting in named:
            raise ConfigError(f"{group}: {named[setting]} and {text} both say what {setting} is; give one of them")
        named[setting] = text


def _with_own_name(text: str) -> str:
    key, equals, values = text.partition("=")
    group = key.lstrip("+")
    if not equals or group not in {*OWN_NAMES, *OWN_NAMES.values(), *OWN_SETTINGS, *OWN_CLASSES}:
        return text
    names = [without_files(unquoted(value), group) for value in VALUE.findall(values)]
    own = [name for name in names if object_name(name) or is_level_file(name)]
    if not own:
        return text
    if group in OWN_CLASSES:
        return f"{key}={','.join(register_own(group, name) if name in own else name for name in names)}"
    if len(own) < len(names) and group in OWN_NAMES:
        raise ConfigError(
            f"{group}: {text} has names of choices and objects of your own in one list; {OWN_NAMES[group]}={values} takes both"
        )
    texts = (quoted(name) if is_level_file(name) else name for name in names)
    return f"{OWN_NAMES.get(group, key)}={','.join(texts)}"


def quoted(text: str) -> str:
    """A text as a value in Hydra's grammar, whatever characters it has."""
    return QuotedString(text, Quote.single).with_quotes()


def unquoted(text: str) -> str:
    """The text that a value stands for which may be in quotation marks."""
    text = text.strip()
    if text[:1] not in ("'", '"') or text[-1:] != text[:1] or len(text) < 2:
        return text
    mark, inner = text[0], text[1:-1]
    return re.sub(rf"(\\+)(?={mark}|$)", lambda found: found[0][: len(found[0]) // 2], inner)


def without_password_in(text: str) -> str:
    """An override, the address of ``tracking.uri`` without its password, which goes into the environment: Hydra writes and
    prints what was asked for."""
    name, equals, value = text.partition("=")
    if name.lstrip("+") != "tracking.uri":
        return text
    quote = value[:1] if value[:1] in ("'", '"') else ""
    return f"{name}{equals}{quote}{hand_on_password(value.removeprefix(quote))}"


def with_search_path(overrides: Sequence[str], places: Sequence[str]) -> list[str]:
    """The overrides with more places, such as ``pkg://my_lab.conf``, at the end of ``hydra.searchpath``."""
    stated = [one for one in parse(overrides) if one.key_or_group == SEARCH_PATH]
    all_places = [*(place for one in stated for place in one.value()), *places]  # type: ignore[union-attr]
    rest = [text for text in overrides if text not in {one.input_line for one in stated}]
    listed = ",".join(map(quoted, dict.fromkeys(all_places)))
    return [*rest, f"{SEARCH_PATH}=[{listed}]"] if all_places else rest


def single_runs(overrides: Sequence[str]) -> list[list[str]]:
    """Lists of overrides without sweeps that together name every swept choice of a group, every swept own object and number of
    frames; of other sweeps, one value. Raises :class:`ConfigError` for more runs than a sweep may have."""
    number_of_runs(overrides)  # refuses too many of them
    alternatives = [alternatives_of(one) for one in parse(overrides)] or [[text] for text in overrides]
    found = [one for one in alternatives if one]
    return [[one[i % len(one)] for one in found] for i in range(max(map(len, found), default=1))]


def number_of_runs(overrides: Sequence[str]) -> int:
    """How many runs a sweep has; 0 where values are not listed, as in a glob or where another program chooses them.
    Raises :class:`ConfigError` for more than a sweep may have."""
    swept = [one for one in parse(overrides) if one.is_sweep_override()]
    listed = all(one.is_discrete_sweep() and not isinstance(one.value(), Glob) for one in swept)
    number = math.prod(len([*islice(one.sweep_string_iterator(), MOST_RUNS + 1)]) for one in swept) if listed else 0
    require(number <= MOST_RUNS, "--multirun", f"{number:,} runs or more", f"at most {MOST_RUNS:,} runs")
    return number


def alternatives_of(override: Override) -> list[str]:
    """The values of a sweep as overrides, an override that is no sweep itself, or nothing where values are not listed."""
    if not override.is_sweep_override():
        return [str(override.input_line)]
    if not override.is_discrete_sweep() or isinstance(override.value(), Glob):
        return []
    every = is_choice(override) or override.key_or_group in (*OWN_NAMES.values(), FRAMES)
    values = islice(override.sweep_string_iterator(), MOST_RUNS if every else 1)
    return [f"{override.get_key_element()}={value}" for value in values]


def explain_overrides(error: Exception, overrides: Sequence[str], config_name: str) -> str:
    """Which override made Hydra raise ``error``, and the nearest right name; Hydra's own message where none is found."""
    if isinstance(error, MissingConfigException) and error.options is not None:
        group, _, name = str(error.missing_cfg_file).rpartition("/")
        options = [option for option in error.options if not option.startswith("base_")]
        if group == "levels" and name in suites():
            return f"levels: {name} is a suite, and says what is played, too: {SUITE}={name}, or levels.train={name}"
        return f"no {group} is called '{name}'.{did_you_mean(name, options)}"
    if wrong := next((text for text in overrides if not parse([text])), ""):
        about = f"{wrong} cannot be read: {first_line(error)}. A text with such characters takes quotation marks"
        return f"{about}: \"{wrong.partition('=')[0]}='...'\""
    parsed = parse(overrides)
    for one in parsed:
        if is_choice(one) and not one.is_delete() and not isinstance(one.value(), str | list):
            return f"{one.key_or_group}: takes a name, and {one.input_line} gives none"
    try:
        choices = [str(one.input_line) for one in parsed if is_choice(one) or one.key_or_group == SEARCH_PATH]
        settings: Any = OmegaConf.to_container(hydra.compose(config_name, choices))
    except CompactHydraException:
        return with_cause(error)
    known = list(dotted_names(settings))
    stated = (one.key_or_group for one in parsed if not (is_choice(one) or one.is_add() or one.is_hydra_override()))
    open_to_all = tuple(f"{group}.options." for group in WITH_OPTIONS)
    unknown = next((name for name in stated if name not in known and not name.startswith(open_to_all)), None)
    return with_cause(error) if unknown is None else advice_on(unknown, settings, known)


def advice_on(name: str, settings: Mapping[str, Any], known: Sequence[str]) -> str:
    """What to write instead of a name that no setting has, or how to add a setting that files may leave out."""
    first, second, *_ = (*name.split("."), "", "")
    is_own = first in OWN_CLASSES and TARGET in settings.get(first, {})
    if is_own or (first == "grids" and second in settings["grids"]):
        file = settings[first].get("name", settings[first][TARGET]) if is_own else second
        return f"the file of {file} does not state {name}; ++ adds what it does not: ++{name}=..."
    of_group = [one for one in known if one.startswith(f"{first}.")] if "." in name else []
    listed = [one for one in of_group if one.count(".") == 1] or [one.partition(".")[0] for one in known]
    return f"no setting is called '{name}'.{did_you_mean(name, of_group or known, listed)}"


def with_cause(error: Exception) -> str:
    """The text of an error of Hydra's, and that of what caused it."""
    return str(error) if error.__cause__ is None else f"{error}\n{error.__cause__}"


def parse(overrides: Sequence[str]) -> list[Override]:
    """The overrides as Hydra reads them; none where one of them is not in Hydra's grammar, which composing tells."""
    try:
        return OverridesParser.create().parse_overrides(list(overrides))
    except CompactHydraException:
        return []


def is_choice(override: Override) -> bool:
    """Whether an override chooses files of a group, instead of stating a setting."""
    loader = GlobalHydra.instance().config_loader()
    return bool(override.key_or_group and loader.get_group_options(override.key_or_group))


def dotted_names(settings: Mapping[str, Any], place: str = "") -> Iterator[str]:
    """The dotted names of all settings and groups."""
    for key, value in settings.items():
        name = path_of(place, key)
        yield name
        if isinstance(value, Mapping):
            yield from dotted_names(value, name)
