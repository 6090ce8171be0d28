"""The random numbers of rules in plain Python integers: what those of the kernels are held against."""

from segar.language import Number


def keyed_uniform(key: int, tick: int, site: int, slots: tuple[int, ...]) -> Number:
    """The number in [0, 1) of a draw: SplitMix64 over key, sub-step, place of the draw in the rules, and entities."""
    a, b, c = (*slots, 0, 0, 0)[:3]
    z = _scramble(key + (tick + 1) * 0x9E3779B97F4A7C15)
    z = _scramble(z + site * 0xD1B54A32D192ED03)
    z = _scramble(z + (a * 65536 + b) * 0x8CB92BA72F3D8DD7 + c)
    return Number((z >> 11) / 2.0**53)


def _scramble(z: int) -> int:
    z %= 2**64
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % 2**64
    return z ^ (z >> 31)
