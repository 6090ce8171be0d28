"""Reading YAML that people write: a key that stands twice is refused, where YAML's own readers take the last one."""

import math
from typing import Any

import yaml

MERGE = "tag:yaml.org,2002:merge"
MOST_VALUES = 10**6  # that a text stands for, whose parts may mention each other


class _OnceEach(yaml.SafeLoader):
    """Reads plain data in which every key of a mapping stands once."""

    def construct_document(self, node: yaml.Node) -> Any:
        if _values_of(node, {}) > MOST_VALUES:
            raise ValueError(f"a part of it contains itself, or it stands for more than {MOST_VALUES:,} values")
        return super().construct_document(node)


def _values_of(part: Any, known: dict[int, float]) -> float:
    """How many values a node stands for, or a key with its value: those of a part count each time that it is mentioned."""
    if isinstance(part, tuple):
        return sum(_values_of(one, known) for one in part)
    if id(part) not in known:
        known[id(part)] = math.inf  # as long as its parts are counted
        parts = [] if isinstance(part, yaml.ScalarNode) else part.value
        known[id(part)] = 1 + sum(_values_of(one, known) for one in parts)
    return known[id(part)]


def _mapping(loader: _OnceEach, node: yaml.MappingNode) -> dict[Any, Any]:
    lines: dict[Any, int] = {}
    for key_node, _ in node.value:
        if key_node.tag == MERGE or not isinstance(key_node, yaml.ScalarNode):
            continue
        key, line = loader.construct_object(key_node), key_node.start_mark.line + 1
        if key in lines:
            raise ValueError(
                f"line {line}: the key {key} stands there for the second time; the first is in line {lines[key]}"
            )
        lines[key] = line
    loader.flatten_mapping(node)
    return yaml.SafeLoader.construct_mapping(loader, node, deep=True)


_OnceEach.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)


def read_yaml(text: bytes) -> Any:
    """The plain data of a YAML text; no code that it names is imported.

    Raises:
        ValueError: it is no YAML, a key of a mapping stands twice (the message names the line), or it is nested too deeply,
            contains itself, or stands for more than a million values.
    """
    try:
        return yaml.load(text.decode(), _OnceEach)
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f"line {error.problem_mark.line + 1}: "
        raise ValueError(f"{line}{error.problem or 'it is no YAML'}{_tabs(text.decode(), error)}") from error
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except yaml.YAMLError as error:  # characters that no YAML may hold
        raise ValueError(str(error).replace("\n", ", ")) from error


def _tabs(text: str, error: yaml.MarkedYAMLError) -> str:
    """What to say of a line that begins with a tab."""
    lines, mark = text.splitlines(), error.problem_mark
    line = lines[mark.line] if mark is not None and mark.line < len(lines) else ""
    return "; indent it by spaces" if "\t" in line[: len(line) - len(line.lstrip())] else ""
