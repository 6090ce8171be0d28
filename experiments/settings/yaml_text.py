"""Reading YAML that people write: a key that stands twice is refused, where YAML's own readers take the last one."""

from typing import Any

import yaml

from segar.experiments.settings.errors import ConfigError

MERGE = "tag:yaml.org,2002:merge"


class _OnceEach(yaml.SafeLoader):
    """Reads plain data in which every key of a mapping stands once."""


def _mapping(loader: _OnceEach, node: yaml.MappingNode) -> dict[Any, Any]:
    lines: dict[Any, int] = {}
    for key_node, _ in node.value:
        if key_node.tag == MERGE or not isinstance(key_node, yaml.ScalarNode):
            continue
        key, line = loader.construct_object(key_node), key_node.start_mark.line + 1
        if key in lines:
            raise ConfigError(
                f"line {line}: the key {key} stands there for the second time; the first is in line {lines[key]}"
            )
        lines[key] = line
    loader.flatten_mapping(node)
    return yaml.SafeLoader.construct_mapping(loader, node, deep=True)


_OnceEach.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)


def read_yaml(text: str) -> Any:
    """The plain data of a YAML text.

    Raises:
        ConfigError: it is no YAML, or a key of a mapping stands twice; the message names the line.
    """
    try:
        return yaml.load(text, _OnceEach)
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f"line {error.problem_mark.line + 1}: "
        raise ConfigError(f"{line}{error.problem or 'it is no YAML'}{_tabs(text, error)}") from error
    except RecursionError:
        raise ConfigError("it is nested too deeply") from None
    except yaml.YAMLError as error:  # characters that no YAML may hold
        raise ConfigError(str(error).replace("\n", ", ")) from error


def _tabs(text: str, error: yaml.MarkedYAMLError) -> str:
    """What to say of a line that begins with a tab."""
    lines, mark = text.splitlines(), error.problem_mark
    line = lines[mark.line] if mark is not None and mark.line < len(lines) else ""
    return "; indent it by spaces" if "\t" in line[: len(line) - len(line.lstrip())] else ""
