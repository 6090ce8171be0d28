"""Reading YAML that people write: a key that stands twice is refused, where YAML's own readers take the last one."""

from typing import Any

import yaml

from experiments.settings.errors import ConfigError

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
        ConfigError: a key of a mapping stands twice; the message names the key and both lines.
        yaml.YAMLError: it is no YAML.
    """
    return yaml.load(text, _OnceEach)
