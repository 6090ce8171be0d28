"""A linker for one WebAssembly object as LLVM emits it: it becomes a module that runs by itself.

The memory begins with the stack, so that a stack that overflows ends in a trap and not in the data behind it. The data
follow, and then ``__heap_base``. Formats: the WebAssembly core specification, and ``Linking.md`` (version 2) of its tool
conventions.
"""

from dataclasses import dataclass, field
from io import BytesIO

from segar.errors import SegarError

CUSTOM, TYPE, IMPORT, FUNCTION, MEMORY, GLOBAL, EXPORT, CODE, DATA, DATA_COUNT = 0, 1, 2, 3, 5, 6, 7, 10, 11, 12
OF_FUNCTION, OF_TABLE, OF_MEMORY, OF_GLOBAL = range(4)  # what an import is
SYMBOL_TABLE, DATA_SYMBOL, UNDEFINED, NAMED = 8, 1, 0x10, 0x40
# Kinds of relocations: those that hold without change, since functions, types and globals keep their numbers; and addresses.
UNCHANGED = {0: "FUNCTION_INDEX_LEB", 6: "TYPE_INDEX_LEB", 7: "GLOBAL_INDEX_LEB"}
ADDRESS_LEB, ADDRESS_SLEB, ADDRESS_I32 = 3, 4, 5
PAGE = 1 << 16


def leb(number: int) -> bytes:
    """An unsigned integer in LEB128."""
    out = bytearray()
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    return bytes([*out, number])


def signed_leb(number: int) -> bytes:
    """A signed integer in LEB128."""
    out = bytearray()
    while not -64 <= number < 64:
        out.append(number & 127 | 128)
        number >>= 7
    return bytes([*out, number & 127])


def name(text: str) -> bytes:
    """A name as WebAssembly has it."""
    return leb(len(text.encode())) + text.encode()


def padded(number: int) -> bytes:
    """An integer in five bytes of LEB128, as relocated places have it; one below 2^31 reads alike signed and unsigned."""
    return bytes([*(number >> 7 * k & 127 | 128 for k in range(4)), number >> 28])


def section(kind: int, body: bytes) -> bytes:
    """A section of a module."""
    return bytes([kind]) + leb(len(body)) + body


class Reader(BytesIO):
    """Reads numbers and names from bytes."""

    @property
    def more(self) -> bool:
        return self.tell() < len(self.getbuffer())

    def byte(self) -> int:
        return self.read(1)[0]

    def number(self) -> int:
        value = shift = 0
        while True:
            byte = self.byte()
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    def signed(self) -> int:
        start = self.tell()
        value = self.number()
        bits = 7 * (self.tell() - start)
        return value - (1 << bits) if value >> bits - 1 else value

    def name(self) -> str:
        return self.read(self.number()).decode()


@dataclass
class ObjectFile:
    """An object as LLVM emits it.

    Attributes:
        sections: bodies by kind. functions: numbers of the defined functions, by name.
        segments: of data, where each begins, and its content.
        addresses: of each data symbol, by its number among all symbols; None for other symbols.
        relocations: kind, place, number of the symbol and addend, by the kind of the section in which they are.
    """

    sections: dict[int, bytes] = field(default_factory=dict)
    functions: dict[str, int] = field(default_factory=dict)
    addresses: list[int | None] = field(default_factory=list)
    relocations: dict[int, list[tuple[int, int, int, int]]] = field(default_factory=dict)
    segments: list[tuple[int, bytes]] = field(default_factory=list)


def link(obj: bytes, exports: list[str], stack: int) -> bytes:
    """The module that exports these functions, ``memory`` and ``__heap_base``.

    Raises:
        SegarError: the object needs functions, tables or globals from outside, or relocations of an unknown kind.
    """
    read = read_object(obj)
    begin = -(-stack // 16) * 16
    end = max((start + len(content) for start, content in read.segments), default=0)
    top = -(-(begin + end) // 16) * 16
    code, data = (relocated(read, kind, begin) for kind in (CODE, DATA))
    parts = [b"\0asm\1\0\0\0", section(TYPE, read.sections[TYPE]), section(FUNCTION, read.sections[FUNCTION])]
    parts.append(section(MEMORY, leb(1) + b"\0" + leb(-(-top // PAGE))))
    constants = [(1, begin), (0, top)]  # the stack's pointer, which changes, and __heap_base
    kinds = [b"\x7f" + bytes([changes]) + b"\x41" + signed_leb(value) + b"\x0b" for changes, value in constants]
    parts.append(section(GLOBAL, leb(len(kinds)) + b"".join(kinds)))
    names = {"memory": bytes([OF_MEMORY, 0]), "__heap_base": bytes([OF_GLOBAL, 1])}
    names |= {one: bytes([OF_FUNCTION]) + leb(read.functions[one]) for one in exports}
    listed = b"".join(name(one) + what for one, what in names.items())
    parts.append(section(EXPORT, leb(len(names)) + listed))
    if DATA_COUNT in read.sections:
        parts.append(section(DATA_COUNT, read.sections[DATA_COUNT]))
    parts.append(section(CODE, code))
    if DATA in read.sections:
        parts.append(section(DATA, shifted_segments(data, begin)))
    return b"".join(parts)


def read_object(obj: bytes) -> ObjectFile:
    """The parts of an object that linking needs."""
    read, reader, order, custom = ObjectFile(), Reader(obj[8:]), [], []
    while reader.more:
        kind = reader.byte()
        body = reader.read(reader.number())
        order.append(kind)
        if kind == CUSTOM:
            inside = Reader(body)
            custom.append((inside.name(), inside))
        else:
            read.sections[kind] = body
    check_imports(read)
    read.segments = segments(read.sections.get(DATA, b"\0"))
    for name, inside in custom:
        if name == "linking":
            read_symbols(read, inside)
    for name, inside in custom:
        if name.startswith("reloc."):
            kind = order[inside.number()]
            read.relocations[kind] = [read_relocation(inside) for _ in range(inside.number())]
    return read


def segments(body: bytes) -> list[tuple[int, bytes]]:
    """Where each segment in the section of data begins, and its content."""
    reader, found = Reader(body), []
    for _ in range(reader.number()):
        if reader.number() != 0 or reader.byte() != 0x41:
            raise SegarError("the linker knows only segments of data with a constant address")
        start = reader.signed()
        reader.byte()
        found.append((start, reader.read(reader.number())))
    return found


def read_symbols(read: ObjectFile, reader: Reader) -> None:
    """The numbers of functions and the addresses of data, from the section ``linking``."""
    if reader.number() != 2:
        raise SegarError("the linker knows version 2 of the section 'linking' only; use llvmlite 0.44 to 0.50")
    while reader.more:
        kind, part = reader.byte(), Reader(reader.read(reader.number()))
        for _ in range(part.number() if kind == SYMBOL_TABLE else 0):
            what, flags = part.byte(), part.number()
            address = None
            if what == DATA_SYMBOL:
                part.name()
                if not flags & UNDEFINED:
                    segment, offset = part.number(), part.number()
                    part.number()
                    address = read.segments[segment][0] + offset
            else:
                number = part.number()
                if what != 3 and (not flags & UNDEFINED or flags & NAMED):  # 3: a section, which has no name
                    name = part.name()
                    if what == OF_FUNCTION:
                        read.functions[name] = number
            read.addresses.append(address)


def read_relocation(reader: Reader) -> tuple[int, int, int, int]:
    """Kind, place, symbol and addend."""
    kind, place, symbol = reader.byte(), reader.number(), reader.number()
    return kind, place, symbol, 0 if kind in UNCHANGED else reader.signed()


def check_imports(read: ObjectFile) -> None:
    """Raises :class:`SegarError` unless the memory and the stack's pointer are all that the object imports."""
    reader = Reader(read.sections.get(IMPORT, b"\0"))
    for _ in range(reader.number()):
        reader.name()
        name, kind = reader.name(), reader.byte()
        if kind == OF_MEMORY:
            if reader.number() & 1:
                reader.number()
            reader.number()
        elif kind == OF_GLOBAL and name == "__stack_pointer":
            reader.read(2)
        else:
            raise SegarError(f"the module imports {name}, which a page cannot give it")


def relocated(read: ObjectFile, kind: int, begin: int) -> bytes:
    """A section's body with the addresses of data moved to where they lie, ``begin`` bytes on."""
    body = bytearray(read.sections.get(kind, b""))
    for what, place, symbol, addend in read.relocations.get(kind, ()):
        if what in UNCHANGED:
            continue
        address = read.addresses[symbol] if symbol < len(read.addresses) else None
        if what not in (ADDRESS_LEB, ADDRESS_SLEB, ADDRESS_I32) or address is None:
            raise SegarError(f"the linker knows no relocation of kind {what}; use llvmlite 0.44 to 0.50")
        value = address + addend + begin
        new = value.to_bytes(4, "little") if what == ADDRESS_I32 else padded(value)
        body[place : place + len(new)] = new
    return bytes(body)


def shifted_segments(body: bytes, begin: int) -> bytes:
    """The section of data with its segments ``begin`` bytes on."""
    moved = [b"\0\x41" + signed_leb(at + begin) + b"\x0b" + leb(len(part)) + part for at, part in segments(body)]
    return leb(len(moved)) + b"".join(moved)
